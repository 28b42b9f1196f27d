"""How often slow faults could be named by their date at all, how often they are, and whether false alarms are as stated.

Fleets are drawn as what each date leaves of a recording (rows of torque in units of the noise, with what differs from date to
date), not simulated: a fleet takes seconds. The faults, and when they are due, are those of ``benchmarks/fleet.py``.

Run ``python benchmarks/fleet_power.py faults [--fleets N] [--seed S]``: beside ours stand two bounds on the same draws. Both
know the scatter, the arm's cause, sign, start and growth, and share the false alarms among arms as ours do. The first
needs to look at nothing else; the second pays for all causes and shapes, as who does not know them has to.

``python benchmarks/fleet_power.py healthy`` draws fleets in which nothing changes.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from fleet import DAILY, FAULTS, FLEET, MONTHS, SlowFault, date_name, first_at, is_right, run_of_fleet, with_dates
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.special import ndtr

from scara_ident.arrays import Array
from scara_ident.fleet.causes import REPORTED_RUN_KINDS
from scara_ident.fleet.changes import FALSE_CHANGE_LEVEL, arms_counted, min_probability, trials_of
from scara_ident.fleet.fleet import changes_of
from scara_ident.fleet.folder import list_fleet
from scara_ident.fleet.history import DateRows, History, common_removed, noise_of
from scara_ident.fleet.scatter import Scatter, fleet_scatter
from scara_ident.fleet.table import quantities
from scara_ident.fleet.visit import Visit, look
from scara_ident.model.model import build_model
from scara_ident.recording.recording import write_recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm

# Before this many dates no fault has reached a size at which it could be named.
FIRST = 5
# Reports of how many dates are drawn of healthy fleets.
HEALTHY_DATES = (3, 7, 12)


@dataclass(frozen=True, eq=False)
class Design:
    """What all arms and dates of a drawn fleet share: one date of a healthy arm."""

    visit: Visit
    history: History

    @property
    def row(self) -> DateRows:
        """What that date says."""
        return self.history.rows[0]

    def along(self, fault: SlowFault) -> Array:
        """Return what one unit of a fault does on the rows."""
        label = fault.quantity.rpartition(": ")[2]
        k = next(k for k, cause in enumerate(self.history.causes) if cause.label == label)
        return self.row.directions[k][:, 0]


def design() -> Design:
    robot = load_robot()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "arm" / date_name(0)
        place.mkdir(parents=True)
        write_recording(run_of_fleet((999, 0, 0))[2], place / "OJD_1.parquet")
        visit, faults = look(pickle.dumps(robot), "complete", list_fleet(folder)[0])
    if visit is None:
        raise RuntimeError(f"the design's recording cannot be used: {faults}")
    return Design(visit, History("arm", (date_name(0),), (visit,), build_model(robot)))


def daily() -> Array:
    """Return a root of the covariance of `scara_ident.fleet.causes.RUN_KINDS`, joint by joint: all friction of a joint together."""
    each = [(DAILY[0], DAILY[1], DAILY[2] * noise, DAILY[3]) for noise in virtual_arm().torque_noise]
    return block_diag(*(REPORTED_RUN_KINDS * std for std in each))


def drawn(known: Design, random: np.random.Generator, faulty: bool) -> Array:
    """Draw a fleet's torque in units of the noise, shape (arms, dates, rows)."""
    row, along = known.row, known.row.runs @ daily()
    runs = random.standard_normal((FLEET, MONTHS, along.shape[1]))
    torque = random.standard_normal((FLEET, MONTHS, len(row.torque))) + runs @ along.T
    for arm, fault in FAULTS.items() if faulty else ():
        torque[arm] += np.outer([fault.at(month) for month in range(MONTHS)], known.along(fault))
    return torque


def histories_of(known: Design, torque: Array) -> list[History]:
    visit = known.visit
    sizes = [len(own) for own in visit.columns]

    def on(date: Array) -> Visit:
        factors = []
        for own, rows, part in zip(visit.factors, visit.rows, np.split(date, np.cumsum(sizes)[:-1]), strict=True):
            factor = own.copy()
            factor[: len(part), len(part)] = part * noise_of(own, rows)
            factors.append(factor)
        return replace(visit, factors=tuple(factors))

    dates, model = tuple(date_name(month) for month in range(MONTHS)), known.history.model
    return [History(f"arm{arm:03d}", dates, tuple(map(on, each)), model) for arm, each in enumerate(torque)]


def best_probabilities(known: Design, torque: Array, count: int) -> Array:
    """Return of each faulty arm the probability of the one test that knows everything, after so many dates."""
    found, std = [], daily()
    for arm, fault in FAULTS.items():
        rows = [replace(known.row, torque=date).whitened(std) for date in torque[arm, :count]]
        left, basis = common_removed(rows)
        along = replace(known.row, torque=known.along(fault)).whitened(std).torque
        aim = np.concatenate([fault.at(month) * along for month in range(count)])
        both = np.concatenate(basis)
        aim -= both @ (both.T @ aim)
        size = float(np.linalg.norm(aim))
        found.append(ndtr(-aim @ np.concatenate(left) / size) if size > 0.0 else 1.0)
    return np.array(found)


def named_of(probabilities: Array) -> NDArray[np.bool_]:
    """Return which of the faulty arms are named at `FALSE_CHANGE_LEVEL`; of the others none helps."""
    whole = np.concatenate([np.minimum(1.0, probabilities), np.ones(FLEET - len(probabilities))])
    return np.asarray(probabilities * arms_counted(list(whole)) < FALSE_CHANGE_LEVEL)


def faults(fleets: int, seed: int) -> None:
    known = design()
    ways = ("the one test that knows all", "the same, paying for all", "ours")
    hits: dict[str, list[NDArray[np.bool_]]] = {way: [] for way in ways}
    false, named, spoilt, dues = 0, 0, 0, []
    start = time.process_time()
    for number in range(fleets):
        torque = drawn(known, np.random.default_rng([seed, number]), True)
        each = histories_of(known, torque)
        told = quantities(each)
        due = np.array([first_at(told[f"arm{arm:03d}"], fault, 4.0) or MONTHS + 1 for arm, fault in FAULTS.items()])
        dues.append(due)
        seen = {way: np.full(len(FAULTS), MONTHS + 1) for way in ways}
        wrong: set[str] = set()
        for count in range(FIRST, int(max(due)) + 1):
            some = [with_dates(item, count) for item in each]
            found = changes_of(some)
            arms = {arm for arm, changes in found.items() if changes}
            wrong_now = arms - {f"arm{arm:03d}" for arm in FAULTS}
            named, false, wrong = named + len(arms), false + len(wrong_now), wrong | wrong_now
            best = best_probabilities(known, torque, count)
            tried = trials_of(some[0], Scatter(daily(), {}, 1.0, {}))
            ours = np.array([is_right(found[f"arm{arm:03d}"], fault) for arm, fault in FAULTS.items()])
            for way, right in zip(ways, (named_of(best), named_of(2.0 * tried * best), ours), strict=True):
                seen[way][right] = np.minimum(seen[way][right], count)
        spoilt += bool(wrong)
        for way in ways:
            hits[way].append(seen[way] <= due)
    seconds = (time.process_time() - start) / fleets
    print(f"{fleets} fleets drawn, seed {seed}, looks after {FIRST} dates and more; {seconds:.1f} s of CPU a fleet")
    print(f"{'fault':28}{'due':>5}" + "".join(f"{way:>30}" for way in ways))
    for k, fault in enumerate(FAULTS.values()):
        shares = "".join(f"{np.mean([hit[k] for hit in hits[way]]):30.2f}" for way in ways)
        print(f"{fault.effect + ' ' + (fault.joint or ''):28}{np.median(dues, axis=0)[k]:5.0f}{shares}")
    print(
        f"{'all 8 by their date':33}" + "".join(f"{np.mean([np.all(hit) for hit in hits[way]]):30.2f}" for way in ways)
    )
    print(f"{'of 8, on average':33}" + "".join(f"{np.mean([np.sum(hit) for hit in hits[way]]):30.2f}" for way in ways))
    print(
        f"{false} of {named} arms named were healthy ({FALSE_CHANGE_LEVEL * named:.1f} stated), in {spoilt} of {fleets} fleets"
    )


def healthy(fleets: int, seed: int, dates: Sequence[int]) -> None:
    known = design()
    for count in dates:
        least = []
        for number in range(fleets):
            each = histories_of(known, drawn(known, np.random.default_rng([seed, number, 1]), False))
            some = [with_dates(item, count) for item in each]
            scatter = fleet_scatter(some)
            tried = trials_of(some[0], scatter)
            least.append([min_probability(item, scatter, tried) for item in some])
        named = sum(arms_counted(own) * min(own) < FALSE_CHANGE_LEVEL for own in least)
        arms = np.ravel(least)
        tail = ", ".join(
            f"{np.sum(arms < p)} below {p:g} ({len(arms) * p:.1f})" for p in (0.1, 0.01, FALSE_CHANGE_LEVEL / FLEET)
        )
        print(
            f"{count} dates: {named} of {fleets} healthy fleets named an arm ({FALSE_CHANGE_LEVEL * fleets:.1f} stated); ",
            end="",
        )
        print(f"of {len(arms)} arms' probabilities {tail}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("faults", "healthy"))
    parser.add_argument("--fleets", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dates", type=int, nargs="+", default=HEALTHY_DATES)
    options = parser.parse_args()
    if options.what == "faults":
        faults(options.fleets, options.seed)
    else:
        healthy(options.fleets, options.seed, options.dates)


if __name__ == "__main__":
    main()
