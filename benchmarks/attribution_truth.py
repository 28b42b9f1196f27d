"""One set of the attribution benchmark: what the diagnosis says of it, beside what it was and what the true model reaches."""

from __future__ import annotations

import multiprocessing
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from virtual_conditions import Asked
from virtual_sets import VirtualSet, simulate_set

from scara_ident.arrays import Array
from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.fitting.correction import taken_out
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.diagnosis.testing.selection_step import SelectionStep, model_with, observed_at_every_sample
from scara_ident.effects import CATALOGUE, Member, Scene
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.estimate import joint_errors
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.simulation import Effect

Item = dict[str, Any]
# Columns by what a covered parameter is of; the rest are inertial.
FRICTION = ("a0", "a1", "a2", "a3")
# What families call the effects' parameters.
OTHER_NAMES = {"_lost_share": "loss_coefficient", "_flown_width": "width"}
# Effects whose columns share something with the base model, so that its parameters mean something else beside them: the
# spring's rest is an offset, and a gain is one of all torques of its joint.
SHARING = {"spring": ("offset",), "torque_gain_mismatch": ("inertial", "friction", "offset")}


class OutOfTimeError(Exception):
    """A diagnosis took longer than it may."""


def set_alone(kind: str, seed: int, robot: str, asked: Asked, limit: int) -> Item | str:
    """Work on a set in a process that is used once: it can be stopped, and tells its peak memory.

    Returns
    -------
    Item, or str
        Why the set could not be simulated, as where a controller shakes the arm.
    """
    # The server that it is forked from has imported all once.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["attribution_truth"])
    with ProcessPoolExecutor(1, mp_context=context, max_tasks_per_child=1) as pool:
        return pool.submit(one_set, kind, seed, robot, asked, limit).result()


def one_set(kind: str, seed: int, robot: str, asked: Asked, limit: int) -> Item | str:
    """Simulate a set, diagnose it, and compare with what the arm was; return why where it could not be simulated.

    Parameters
    ----------
    kind, seed, robot, asked
        See `virtual_sets.simulate_set`.
    limit : int
        Seconds after which the diagnosis is given up.
    """
    with tempfile.TemporaryDirectory() as place:
        began = time.perf_counter()
        try:
            made = simulate_set(kind, seed, robot, Path(place) / "set", asked)
        except ScaraIdentError as error:
            return str(error)
        was = made.truth()
        item: Item = {
            "robot": robot,
            "kind": kind,
            "seed": seed,
            "factors": list(made.factors),
            "conditions": made.conditions.as_dict(),
            "true": was["effects"],
            "true_events": was.get("events", []),
            "simulated_seconds": time.perf_counter() - began,
            "found": [],
            "tentative": [],
        }
        before = _peak_memory()
        began = time.perf_counter()
        result, item["verdict"], item["said"] = _diagnosed(made, limit)
        # With the simulation before it: what the diagnosis adds to that is the difference.
        item |= {"seconds": time.perf_counter() - began, "memory": _peak_memory(), "memory_before": before}
        return item if result is None else item | _compared(result, made, was)


def _diagnosed(made: VirtualSet, limit: int) -> tuple[Diagnosis | None, str, str]:
    def give_up(*_: Any) -> None:
        raise OutOfTimeError

    signal.signal(signal.SIGALRM, give_up)
    signal.alarm(limit)
    try:
        result = diagnose(made.robot, made.training, validation=made.held_out)
        return result, result.verdict, ""
    except OutOfTimeError:
        return None, "out of time", f"more than {limit} s"
    except ScaraIdentError as error:
        return None, "refused", str(error)
    except Exception as error:
        # A fault of the package: counted, and the run goes on.
        return None, "crashed", f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)


def _compared(result: Diagnosis, made: VirtualSet, was: Item) -> Item:
    told = diagnosis_dict(result)
    oracle = true_model_error(result, made)
    after, reference = told["validation"]["after"], oracle and oracle["validation"]
    without = oracle.pop("without") if oracle else []
    return {
        "found": [_found(effect) for effect in told["effects"]],
        "tentative": [
            {"effect": _of(effect, "effect"), "joint": _of(effect, "joint")}
            for effect in getattr(result, "tentative", ())
        ],
        "corrected": _corrected(result),
        "events": told.get("events", []),
        "not_shown": {item.joint: item.why for item in result.evidence if not item.shown},
        "unexplained": told["unexplained"] and told["unexplained"]["joint"],
        "band": list(told["band_hz"].values()),
        "noise": told["noise_floor"],
        "training": told["training"],
        "validation": told["validation"],
        "true_model": oracle,
        "to_true_model": worst_ratio(after, reference),
        "fitted_to_true_model": worst_ratio(oracle["fitted"], reference) if oracle else None,
        "late": _late(made),
        "strength": strength(told["training"]["before"], oracle and oracle["training"]),
        "strengths": [strength(errors, oracle["training"]) for errors in without],
        "strongest": [strongest(errors, oracle["training"]) for errors in without],
        "limits": {joint: item["detection_limit"] for joint, item in told["evidence"].items()},
        "coverage": coverage(told["parameters"], true_parameters(made, was), [effect.name for effect in made.effects]),
    }


def _found(effect: Item) -> Item:
    return {
        "effect": effect["effect"],
        "joint": effect["joint"],
        "group": effect["confounded_with"],
        "parameters": {name: [value["value"], value["std"]] for name, value in effect["parameters"].items()},
        "p_value": effect["p_value"],
        "gain": effect["gain"],
        "held_out": effect["held_out"],
        "size_determined": effect["size_determined"],
    }


def _corrected(result: Diagnosis) -> dict[str, float]:
    """Return what was taken out of the data, though it may be too small to be called an effect."""
    correction = result.search.correction
    return {} if correction is None else {correction.candidate.effect.name: float(np.mean(correction.value))}


def _of(effect: Any, name: str) -> Any:
    return effect.get(name) if isinstance(effect, dict) else getattr(effect, name, None)


def _late(made: VirtualSet) -> float:
    """Return by how much the training recordings are late on average, by an effect and by what runs differ by, s."""
    delays = [effect.as_dict()["parameters"]["delay"] for effect in made.effects if effect.name == "time_delay"]
    return float(sum(delays) + np.mean([state.delay for state in made.states[: len(made.training)]]))


def true_model_error(result: Diagnosis, made: VirtualSet) -> dict[str, Any] | None:
    """Fit the true model, at its true nonlinear parameters, to the same recordings in the same bands.

    It knows by how much the training recordings are late on average, what each run has of its own it does not. With
    "fitted" the true structure is all that is known, and its nonlinear parameters are fitted with the others, how late the
    recordings are among them if they are.

    Returns
    -------
    dict or None
        Rms of each joint in training and validation, in validation with all fitted, and in training without each of the
        effects in turn; None where the catalogue has no family for an effect, or the arm's torque nothing of it.
    """
    scene, bands = result.search.scene, result.search.bands
    joints = made.robot.joints
    late = _late(made)
    others = [_candidates(effect, made, scene) for effect in made.effects if effect.name != "time_delay"]
    training, held_out = (
        prepare([shifted(item, late) for item in items], bands) for items in (made.training, made.held_out)
    )
    best = None
    for chosen in product(*others):
        model = model_with(scene, chosen)
        fitted = observe(model, training)
        value = wls(fitted).value
        errors = _errors(joints, joint_errors(value, fitted))
        if best is None or np.prod(list(errors.values())) < np.prod(list(best[3].values())):
            best = chosen, model, value, errors
    if best is None:
        return None
    chosen, model, value, errors = best
    validation = _errors(joints, joint_errors(value, observe(model, held_out)))
    own, known, fitted_late = _all_fitted(result, chosen, made.training, late=late != 0.0)
    held_out = prepare([shifted(item, fitted_late) for item in made.held_out], bands)
    return {
        "training": errors,
        "validation": validation,
        "fitted": _errors(joints, joint_errors(known, observe(own, held_out))),
        "without": _without_each(result, made, chosen, training),
    }


def _without_each(
    result: Diagnosis, made: VirtualSet, chosen: Sequence[Candidate], training: PreparedData
) -> list[dict[str, float]]:
    """Return the rms of each joint in training of the true model without each of its effects, in their order."""
    found, left = [], list(chosen)
    for effect in made.effects:
        kept, data = list(chosen), training
        if effect.name == "time_delay":
            late = _late(made) - effect.as_dict()["parameters"]["delay"]
            data = prepare([shifted(item, late) for item in made.training], training.bands)
        else:
            kept.remove(left.pop(0))
        fitted = observe(model_with(result.search.scene, kept), data)
        found.append(_errors(made.robot.joints, joint_errors(wls(fitted).value, fitted)))
    return found


def _all_fitted(
    result: Diagnosis, chosen: Sequence[Candidate], recordings: Sequence[Recording], *, late: bool
) -> tuple[TorqueModel, Array, float]:
    """Fit effects with their nonlinear parameters, and return the model, its parameters and how late recordings are."""
    base, criteria = result.search.base, result.search.step.criteria
    observations = observe(base, prepare(recordings, result.search.bands))
    start = wls(observations)
    scene, delay = scene_of(base, start.value, observations), 0.0
    step = SelectionStep(scene, CandidateColumns(observations), tuple(chosen), start.weights, 1, criteria)
    for _ in range(1 + late):
        step = tune(step)
        if late:
            columns, more = taken_out(step, Candidate(TimeDelay(), Member(None)))
            step, delay = replace(step, columns=columns), delay + float(more.value[0])
    return model_with(step.scene, step.chosen), wls(observed_at_every_sample(step)).value, delay


def _errors(joints: Sequence[str], errors: Sequence[Any]) -> dict[str, float]:
    return {joint: error.rms for joint, error in zip(joints, errors, strict=True) if error}


def _candidates(effect: Effect, made: VirtualSet, scene: Scene) -> list[Candidate]:
    """Return the member of the effect's family that has its nonlinear parameters, or several of which one is closest.

    None of an effect that does nothing to this arm's torque, as a tilt to first order to that of a slide that stands.
    """
    values = effect.as_dict()["parameters"]
    joints = made.robot.joints
    place = None if effect.joint is None else joints.index(effect.joint)
    partner = joints.index(effect.other(made.arm)) if hasattr(effect, "other") else None
    for family in (family for family in CATALOGUE if family.name == effect.name):
        names = [OTHER_NAMES.get(parameter.name, parameter.name) for parameter in family.nonlinear]
        if effect.name == "joint_elasticity" and place is not None:
            # The frequency of the link against its held motor depends on the pose: the one that fits best.
            usual = np.sqrt(values["stiffness"] / made.arm.link_inertia()[place]) / (2.0 * np.pi)
            points = [(float(usual * factor), values["damping_ratio"]) for factor in np.geomspace(0.6, 1.7, 9)]
        elif all(name in values for name in names):
            points = [tuple(float(values[name]) for name in names)]
        else:
            continue
        members = [Member(place, point, partner) for point in points]
        return [Candidate(family, member) for member in members if family.columns(scene, member)]
    return []


def worst_ratio(after: dict[str, float | None], reference: dict[str, float] | None) -> float | None:
    """Return the held-out error over that of the true model on the joint where it is largest."""
    if not reference or not after:
        return None
    ratios = [error / reference[joint] for joint, error in after.items() if error and reference.get(joint)]
    return max(ratios, default=None)


def strength(before: dict[str, float | None], oracle: dict[str, float] | None) -> float | None:
    """Return the rms of what the effects add, over that of what the true model leaves, on the joint where it shows most.

    This, and not the effect's parameter, is its size under conditions that differ from set to set: both are of the
    training recordings within the band worked in.
    """
    excess = _excess(before, oracle)
    return float(np.sqrt(max(0.0, *excess.values()))) if excess else None


def strongest(before: dict[str, float | None], oracle: dict[str, float] | None) -> str | None:
    """Return the joint where an effect shows most."""
    excess = _excess(before, oracle)
    return max(excess, key=lambda joint: excess[joint]) if excess else None


def _excess(before: dict[str, float | None], oracle: dict[str, float] | None) -> dict[str, float]:
    """Return for each joint the mean square of what the effects add, over that of what the true model leaves."""
    oracle = oracle or {}
    return {joint: (error / oracle[joint]) ** 2 - 1.0 for joint, error in before.items() if error and oracle.get(joint)}


def true_parameters(made: VirtualSet, was: Item) -> list[Item]:
    """Return the true parameters of the arm as its recordings can know them.

    Where runs differ, these are their mean over all possible runs; only, recordings of one day know but that day's offsets.
    """
    recorded = [run.day for run in made.conditions.runs if not run.held_out]
    if len(set(recorded)) > 1:
        return list(was["parameters"])
    offsets = {f"p_o{k + 1}": float(x) for k, x in enumerate(made.states[0].torque_offset)}
    return [
        entry | {"value": entry["value"] + offsets.get(entry["name"], 0.0)} if entry["value"] is not None else entry
        for entry in was["parameters"]
    ]


def coverage(found: Sequence[Item], true: Sequence[Item], effects: Sequence[str]) -> dict[str, list[float]]:
    """Return the errors of the base model's parameters in standard deviations, by kind of parameter.

    The truth is that of the arm: its standard parameters, projected on the base parameters by the grouping of the model
    (`simulation.truth`), its friction polynomial and its offsets; where runs differ, their mean over all possible runs.
    Parameters that the recordings leave open have no standard deviation and are not counted, nor those of `SHARING`.
    """
    exact = {entry["name"]: entry["value"] for entry in true}
    errors: dict[str, list[float]] = {"inertial": [], "friction": [], "offset": []}
    shared = {kind for effect in effects for kind in SHARING.get(effect, ())}
    for entry in found:
        name, std = entry["name"], entry.get("std")
        if name not in exact or std is None or not 0.0 < std < np.inf:
            continue
        kind = "offset" if name.startswith("p_o") else "friction" if name.startswith(FRICTION) else "inertial"
        if kind not in shared:
            errors[kind].append(round(float((entry["value"] - exact[name]) / std), 3))
    return errors


def _peak_memory() -> float:
    """Return the largest memory that this process has had, MB."""
    unit = 1024.0 if sys.platform == "linux" else 1024.0**2
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
