"""Run the paper's campaign on the virtual SCARA03 and ask which of its conclusions hold, and what its arm hid.

Run ``python benchmarks/campaign.py [--effect NAME:JOINT:KEY=VALUE ...] [--output FILE.json]``; the figures of the
JSON are made by ``campaign_figures.py``.

1. Scan: one noise-free repetition of the five trajectories for every effect of the catalogue at three or four sizes on all
   joints that can have it. Tables 2, 4 and 5 follow as the paper made them, least squares on 2500 unfiltered samples,
   with noise of Table 1's size drawn on top: on the parameters, where white noise ends up by
   ``A^-1 sum_j sigma_j W_j' e_j``, and on the torque that is predicted. All scenes share the same draws. Their distance
   from the printed tables is the rms of log10(virtual / printed) over the error cells. Beside the effects stands a
   confounder: no effect, but a wider low-pass on the motion.
2. Campaign: six noisy repetitions, without an effect and with the one that came nearest (or those given), through
   `compare` for OLS complete, OLS reduced and consistent. Errors are those of the unfiltered torque, as the paper's.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from campaign_effects import FACTORS, SIGNED, SIGNED_FACTORS, can_be, sized
from campaign_tables import (
    PAPER_SAMPLES,
    campaign_tables,
    conclusions,
    distances,
    drawn_tables,
    printed,
    shares,
    sigma_of,
    unfiltered,
)
from numpy.typing import NDArray

from scara_ident.estimation.observations import observe
from scara_ident.identification.compare import compare
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.paper import REDUCED, TRAJECTORIES
from scara_ident.recording.recording import Recording
from scara_ident.simulation import CATALOGUE, Effect, ReferenceMotion, VirtualArm, parse_effect, simulate, virtual_arm
from scara_ident.simulation.named import named_motion

Array = NDArray[np.float64]

METHODS = (("complete", "ols"), ("reduced", "ols"), ("complete", "consistent"))
DRAWS = 200
READINGS = {"one_run": 1.0, "mean_of_six": 1.0 / np.sqrt(6.0)}
FINER = (0.6, 1.7)
# No effect of the arm but a confounder: motion filtered at that many times the chosen cut-off, so that accelerations are
# noisier, as the paper's may have been; it does not say how it found them.
WIDER = "wider_filter"
WIDER_FACTORS = (1.5, 2.0, 2.5)
RIVALS = ("none", WIDER)
REFINED = 8


@cache
def _motion(name: str) -> ReferenceMotion:
    return named_motion(name, virtual_arm().robot)


def repetitions(
    arm: VirtualArm, names: Sequence[str], effects: Sequence[Effect], count: int, *, noisy: bool, seed: int = 0
) -> list[Recording]:
    """Simulate repetitions of trajectories, with Table 1's noise on each or with none."""
    noise = sigma_of(names) if noisy else np.zeros((len(names), arm.robot.n))
    return [
        simulate(
            replace(arm, torque_noise=noise[k]),
            _motion(name),
            effects=effects,
            seed=seed + k,
            repetition=repetition,
        ).recording
        for k, name in enumerate(names)
        for repetition in range(1, count + 1)
    ]


def scene(task: tuple[str, float], names: Sequence[str], bands: Sequence[float | None], seed: int) -> dict[str, Any]:
    """Simulate one scene of the scan and compare it with the printed tables; ``task`` is an effect and its factor."""
    name, factor = task
    arm = virtual_arm()
    kinds = {kind.name: kind for kind in CATALOGUE}
    effects = () if name in RIVALS else sized(arm, kinds[name], factor)
    if name == WIDER:
        bands = [None if band is None else factor * band for band in bands]
    recordings = repetitions(arm, names, effects, 1, noisy=False, seed=seed)
    model = build_model(arm.robot, "complete")
    recorded = [unfiltered(item) for item in observe(model, prepare(recordings, bands)).each]
    shape = (DRAWS, len(names), arm.robot.n, len(model.columns))
    draws = np.random.default_rng(seed).standard_normal(shape)
    found: dict[str, Any] = {"name": name, "factor": factor, "effects": [effect.as_dict() for effect in effects]}
    # Table 1's sigma is the scatter between runs; whether the tables use one run or the mean of six is not said.
    for reading, share in READINGS.items():
        tables = drawn_tables(recorded, share * sigma_of(names), draws)
        apart = distances(tables, printed(names))
        found[reading] = {
            "distance": {key: float(np.median(value)) for key, value in apart.items()},
            "holds": shares(tables, names),
            "range": np.quantile(apart["both"], [0.05, 0.95]).tolist(),
            "draws": apart["both"].tolist(),
            "tables": replace(
                tables,
                complete=np.median(tables.complete, axis=0),
                reduced=np.median(tables.reduced, axis=0),
                parameters=np.median(tables.parameters, axis=0),
            ).as_dict(),
        }
    return found


def scan(
    kinds: Sequence[type[Effect]],
    names: Sequence[str],
    bands: Sequence[float | None],
    *,
    seed: int = 0,
    processes: int = 1,
    sizes: int = 3,
    refined: int = REFINED,
    filters: Sequence[float] = WIDER_FACTORS,
) -> list[dict[str, Any]]:
    """Try every effect at its sizes, the best ones at sizes between; nearest to the printed tables first."""
    each = partial(scene, names=names, bands=bands, seed=seed)
    tasks = [("none", 0.0), *((WIDER, factor) for factor in filters)]
    for kind in kinds:
        tasks += [(kind.name, factor) for factor in (SIGNED_FACTORS if kind.name in SIGNED else FACTORS)[:sizes]]
    results = _each(each, tasks, processes)
    results.sort(key=_distance)
    arm, named = virtual_arm(), {kind.name: kind for kind in kinds}
    best = list(dict.fromkeys(item["name"] for item in results if item["name"] not in RIVALS))[:refined]
    finer = []
    for name in best:
        first = next(item for item in results if item["name"] == name)
        steps = [first["factor"] * step for step in FINER]
        finer += [(name, factor) for factor in steps if can_be(arm, named[name], factor)]
    results += _each(each, finer, processes)
    results.sort(key=_distance)
    none = next(item for item in results if item["name"] == "none")
    nearest = nearest_of(results)
    for reading in READINGS:
        zero, first = (np.array(item[reading]["draws"]) for item in (none, nearest))
        for item in results:
            draws = np.array(item[reading]["draws"])
            item[reading]["nearer_than_none"] = float(np.mean(draws < zero))
            item[reading]["farther_than_nearest"] = float(np.mean(draws > first))
    for item in results:
        for reading in READINGS:
            del item[reading]["draws"]
    return results


def nearest_of(scenes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the first scene with an effect."""
    return next(item for item in scenes if item["name"] not in RIVALS)


def _distance(item: dict[str, Any]) -> float:
    return float(item["one_run"]["distance"]["both"])


def _each(run: Any, tasks: Sequence[Any], processes: int) -> list[Any]:
    if processes <= 1:
        return [run(task) for task in tasks]
    with ProcessPoolExecutor(max_workers=processes) as pool:
        return list(pool.map(run, tasks))


def campaign(
    arm: VirtualArm,
    names: Sequence[str],
    effects: Sequence[Effect],
    count: int,
    *,
    bands: Sequence[float | None] | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Run `compare` on noisy repetitions; "complete ols" and so on, and ``... errors`` of the unfiltered torque."""
    recordings = repetitions(arm, names, effects, count, noisy=True, seed=seed)
    found: dict[str, Any] = {}
    for model, method in METHODS:
        result = compare(arm.robot, recordings, model=model, method=method, bands=bands)
        used = result.trajectories[0].estimate.method
        if used != method:
            raise RuntimeError(f"asked for {method}, compare used {used}")
        bands = result.bands
        observations = observe(result.model, prepare(recordings, bands))
        places = [[k for k, item in enumerate(recordings) if item.trajectory == name] for name in names]
        each = [observations.of(own) for own in places]
        found[f"{model} {method}"] = result
        # On the torque as recorded, shape (t, t, n).
        found[f"{model} {method} errors"] = np.array(
            [[item.unfiltered_rms(summary.estimate.value) for summary in result.trajectories] for item in each]
        )
        if model == "complete":
            found["torque_rms"] = np.array([item.unfiltered_rms(np.zeros(item.parameters)) for item in each])
    return found


def report(
    scenes: list[dict[str, Any]], runs: dict[str, dict[str, Any]], names: Sequence[str], chosen: str
) -> dict[str, Any]:
    """Print everything and return it for JSON."""
    paper = printed(names)
    content: dict[str, Any] = {"trajectories": list(names), "chosen": chosen, "printed": paper.as_dict()}
    print("Distance from the printed tables: rms of log10(virtual / printed) over the cells of Tables 2 and 4")
    print(
        f"{'effect':34}{'times':>6}{'both':>7}{'5-95 %':>14}{'T2':>6}{'T4':>6}{'j1':>6}{'j2':>6}{'own':>6}{'other':>6}{'T5':>7}{'/sqrt6':>8}{'nearer':>8}{'farther':>8}"
    )
    for item in scenes:
        one, mean = item["one_run"], item["mean_of_six"]
        d = one["distance"]
        print(
            f"{item['name']:34}{item['factor']:6.2f}{d['both']:7.3f}{one['range'][0]:7.3f}{one['range'][1]:7.3f}"
            f"{d['table2']:6.2f}{d['table4']:6.2f}{d['joint1']:6.2f}{d['joint2']:6.2f}{d['own']:6.2f}{d['others']:6.2f}{d['table5']:7.2f}"
            f"{mean['distance']['both']:8.3f}{one['nearer_than_none']:8.0%}{one['farther_than_nearest']:8.0%}"
        )
    content["scan"] = scenes
    columns = {"printed": paper} | {key: campaign_tables(found) for key, found in runs.items()}
    for label, field in (("Table 2, complete", "complete"), ("Table 4, reduced", "reduced")):
        print(f"\n{label}: printed | " + " | ".join(runs))
        for i, predicted in enumerate(names):
            for j in range(2):
                cells = ["".join(f"{x:8.3f}" for x in getattr(t, field)[i, :, j]) for t in columns.values()]
                print(f"{predicted + f' ({j + 1})':9}" + "  |".join(cells))
        for j in range(2):
            cells = ["".join(f"{x:8.3f}" for x in getattr(t, field)[:, :, j].mean(axis=0)) for t in columns.values()]
            print(f"{f'Aver. ({j + 1})':9}" + "  |".join(cells))
    print("\nTable 5: printed | " + " | ".join(runs))
    for row, name in enumerate(REDUCED):
        print(f"{name:9}" + "  |".join("".join(f"{x:8.3f}" for x in t.parameters[row]) for t in columns.values()))
    print("\nJ_d, J_k of each, and the paper's conclusions")
    content["conclusions"] = {}
    for key, tables in columns.items():
        print(f"{key}: J_d {np.round(tables.log_det, 2).tolist()}, J_k {[f'{x:.3g}' for x in tables.condition]}")
        found = conclusions(tables, names)
        content["conclusions"][key] = [item.__dict__ for item in found]
        for item in found:
            print(f"  {'holds' if item.holds else 'FAILS':6} {item.name}: {item.figures}")
    shown = [item for item in scenes if item["name"] in RIVALS or item is nearest_of(scenes)]
    first: dict[str, dict[str, Any]] = {}
    for item in scenes:
        first.setdefault(item["name"], item)
    effects = [item["one_run"]["holds"] for name, item in first.items() if name not in RIVALS]
    print(f"\nShare of {DRAWS} draws of {PAPER_SAMPLES} samples in which they hold, and in how many of {len(effects)}")
    print("effects, each at its nearest size, they hold in most draws")
    print(" ".join(f"{item['name']} x {item['factor']:g}," for item in shown))
    content["effects_where_max_draws_hold"] = {}
    for name in shown[0]["one_run"]["holds"]:
        count = sum(holds[name] > 0.5 for holds in effects)
        content["effects_where_max_draws_hold"][name] = count
        print("".join(f"{item['one_run']['holds'][name]:7.0%}" for item in shown) + f"{count:6d}  {name}")
    content["campaigns"] = {}
    for key, found in runs.items():
        errors, free = found["complete consistent errors"], found["complete ols errors"]
        off = ~np.eye(len(names), dtype=bool)
        ratio = np.exp(np.mean(np.log(errors[off] / free[off]), axis=0))
        print(
            f"{key}: consistent / OLS complete on other trajectories, geometric mean {ratio.round(2).tolist()}, averages:"
        )
        for j in range(2):
            print(f"Aver. ({j + 1})" + "".join(f"{x:8.3f}" for x in errors[:, :, j].mean(axis=0)))
        content["campaigns"][key] = columns[key].as_dict() | {
            "consistent": errors.tolist(),
            "consistent_to_ols": ratio.tolist(),
            "predicted_by_covariance": found["complete ols"].expected.tolist(),
            "in_band": found["complete ols"].errors.tolist(),
            "bands": list(found["complete ols"].bands),
            "sigma": [item.sigma.tolist() for item in found["complete ols"].trajectories if item.sigma is not None],
            "distance": {k: float(v) for k, v in distances(columns[key], paper).items()},
        }
        print(f"sigma {np.round(content['campaigns'][key]['sigma'], 3).tolist()}")
        print("distance", {k: round(v, 3) for k, v in content["campaigns"][key]["distance"].items()})
    return content


def rounded(value: Any) -> Any:
    """Return the same with five significant digits, which is more than noise leaves."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def run(
    kinds: Sequence[type[Effect]] = CATALOGUE,
    names: Sequence[str] = TRAJECTORIES,
    *,
    given: Sequence[Effect] = (),
    count: int = 6,
    sizes: int = 3,
    refined: int = REFINED,
    filters: Sequence[float] = WIDER_FACTORS,
    processes: int = 1,
    seed: int = 0,
) -> dict[str, Any]:
    """Run all stages and return what was found."""
    began, computing = time.perf_counter(), time.process_time()
    arm = virtual_arm()
    runs = {"no effect": campaign(arm, names, (), count, seed=seed)}
    # One processing for all, as the paper's: the bands that the campaign without effects chose.
    bands = runs["no effect"]["complete ols"].bands
    scenes = scan(kinds, names, bands, seed=seed, processes=processes, sizes=sizes, refined=refined, filters=filters)
    nearest = nearest_of(scenes)
    effects: tuple[Effect, ...] = tuple(given)
    chosen = ", ".join(effect.name for effect in given)
    if not effects:
        kind = next(kind for kind in CATALOGUE if kind.name == nearest["name"])
        effects = sized(arm, kind, nearest["factor"])
        chosen = f"{nearest['name']} x {nearest['factor']:g}"
    runs[chosen] = campaign(arm, names, effects, count, bands=bands, seed=seed)
    content = report(scenes, runs, list(names), chosen)
    content["effects"] = [effect.resolve(arm).as_dict() for effect in effects]
    content["seconds"] = time.perf_counter() - began
    content["computing_seconds"] = time.process_time() - computing
    print(f"\n{content['seconds']:.0f} s, {content['computing_seconds']:.0f} s of computing in this process")
    return content


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effect", action="append", default=[], help="effect of the campaign, NAME:JOINT:KEY=VALUE")
    parser.add_argument("--repetitions", type=int, default=6)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/campaign.json"))
    options = parser.parse_args()
    content = run(
        given=[parse_effect(text) for text in options.effect],
        count=options.repetitions,
        processes=options.processes,
        seed=options.seed,
    )
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(rounded(content)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
