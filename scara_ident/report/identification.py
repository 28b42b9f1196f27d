"""An identification as JSON, with the contract's keys, and as sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from scara_ident.calling import asked_for
from scara_ident.estimation import Estimate, JointError
from scara_ident.estimation.consistent.estimator import ConsistentEstimate, links
from scara_ident.estimation.consistent.shape import ShapeChoice
from scara_ident.estimation.estimate import PAPER_SAMPLES
from scara_ident.estimation.noise_bias import bias_sentence
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.pushing import BEYOND_CHANCE, pushes
from scara_ident.estimation.run_variation import MIN_RUNS
from scara_ident.estimation.saved import estimate_dict
from scara_ident.estimation.urdf_scale import scale_sentence, urdf_scale
from scara_ident.estimation.urdf_weight import rotor_sentence, scale_in_words
from scara_ident.export.identified_model import reached_by
from scara_ident.export.result import KEY, rebuild_entry
from scara_ident.identification.identify import (
    Identification,
    determined_in_sums,
    insignificant_parameters,
    of_unknown_std,
    undetermined,
    worst_validation,
)
from scara_ident.manners import listed
from scara_ident.model.terms.friction import Friction
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.recorded_range import faster_than_recorded, recorded_range
from scara_ident.report.doubts import doubts
from scara_ident.robot.robot import Robot

# Names in a sentence, at the most.
MAX_NAMED = 12
# So few recordings in words.
NUMBERS = {1: "one recording", 2: "two recordings"}
# What each shape of friction means.
SHAPES = {
    "lubricated": "dissipates energy, and grows less and less with speed",
    "dissipative": "dissipates energy",
    "free": "no constraint",
}


def identification_dict(identification: Identification) -> dict[str, Any]:
    """Return the content of ``identification.json``."""
    estimate = identification.estimate
    robot = identification.model.robot
    possible = identification.physical_consistency
    nominal = urdf_values(identification.model)
    first, others = headline_and_details(identification)
    reached = reached_by(identification.training)
    content: dict[str, Any] = {
        "robot": robot.name,
        "model": identification.model.name,
        "method": estimate.method,
        "samples": identification.training.samples,
        "parameters": [
            column.entry(value=estimate.value[k], std=estimate.std[k], urdf=nominal[k])
            | {"undetermined": bool(estimate.undetermined[k])}
            for k, column in enumerate(identification.model.columns)
        ],
        "weights": robot.by_joint(estimate.weights),
        "urdf_scale": urdf_scale(estimate, identification.training),
        "std_from": estimate.std_kind,
        "run_variation": estimate.variation.sizes(robot) if estimate.variation else {},
        "noise_bias": bias_of(estimate),
        "log_det": identification.log_det,
        "condition": identification.condition,
        "criteria_samples": PAPER_SAMPLES,
        "physically_consistent": possible.possible,
        "contradictions": list(possible.reasons),
        "distance_to_possible_std": possible.distance_std,
        "band_hz": robot.by_joint(identification.bands),
        "range": None if reached is None else reached.entry(robot),
        "errors": {
            "training": _errors(robot, identification.training_errors()),
            "validation": _errors(robot, identification.validation_errors()),
        },
        "repeatability": {trajectory: robot.by_joint(sigma) for trajectory, sigma in identification.noise.items()},
        "left_out": {
            kind: {item.name: _left_out(robot, item) for item in items.each}
            for kind, items in (("training", identification.training), ("validation", identification.validation))
        },
        "events": [event.entry for event in identification.events],
        "doubts": list(first),
        "summary": [*first, *others],
        "notes": list(identification.notes),
        "estimate": estimate_dict(estimate),
        KEY: rebuild_entry(estimate, identification.training, identification.validation),
    }
    if isinstance(estimate, ConsistentEstimate):
        content["links"] = [
            {"name": link.name, "mass": link.mass, "com": link.com, "inertia": link.inertia} for link in links(estimate)
        ]
        content["armature"] = robot.by_joint(estimate.standard[10 * robot.n :])
        content["held_by"] = list(estimate.active)
        content["friction_shape"] = {
            choice.joint: {"shape": choice.shape, "p_value": choice.p_value, "why": choice.why}
            for choice in estimate.shapes
        }
    return content


def _errors(robot: Robot, errors: Mapping[str, tuple[JointError | None, ...]]) -> dict[str, Any]:
    return {recording: robot.by_joint(map(_error, found)) for recording, found in errors.items()}


def _error(error: JointError | None) -> dict[str, float | None]:
    return dict.fromkeys(field.name for field in fields(JointError)) if error is None else asdict(error)


def _left_out(robot: Robot, item: Observations) -> dict[str, Any]:
    return {"ends_s": item.left_out_ends, "at_rest_share": robot.by_joint(item.left_out_rest)}


def sentences(identification: Identification) -> tuple[str, ...]:
    """Return the result in words: what questions it, then where it generalises worst, and what the data leave open."""
    first, others = headline_and_details(identification)
    return (*first, *others)


def headline_and_details(identification: Identification) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the sentences that stand before the parameters, see `scara_ident.report.doubts`, and all others."""
    held, channels = identification.training, identification.channels
    robot = identification.model.robot
    # Under efforts of opposite sign bodies and gravity are nobody's.
    scale = scale_sentence(None, robot) if channels else scale_in_words(identification.estimate, held)
    first = doubts(identification.estimate, held, held, scale, channels)
    others = _others(identification)
    if scale not in first:
        others.append(scale)
    rotors = None if channels else rotor_sentence(identification.estimate, held)
    return first, (*others, *([] if rotors is None else [rotors]))


def _others(identification: Identification) -> list[str]:
    found, robot = [], identification.model.robot
    worst = worst_validation(identification)
    if worst is not None:
        recording, joint, error = worst
        rms, share = error.beside_own_offset
        beside = "" if error.rms_own_offset is None else " after its own offset is removed"
        unit = robot.torque_unit(robot.joints.index(joint))
        found.append(
            f"The largest held-out error is on {recording}, {joint}: {rms:.3g} {unit} rms{beside}, {share:.1%} of the torque."
        )
        held_out = recorded_range(identification.validation.data)
        faster = faster_than_recorded(
            reached_by(identification.training), held_out.speed, robot, "The held-out recordings are"
        )
        found += [faster] if faster else []
    else:
        found.append(
            f"There are no held-out recordings: give {asked_for('--validate', 'validation')} recordings to measure how well the model predicts."
        )
    open_, in_sums = undetermined(identification), determined_in_sums(identification)
    if in_sums:
        found.append(
            f"{listed(in_sums, MAX_NAMED)} {'is' if len(in_sums) == 1 else 'are'} not determined alone, only in sums "
            f"with others: the standard deviation is larger than the sum of all bodies in the robot description."
        )
    if open_:
        found.append(
            f"The data do not determine {listed(open_, MAX_NAMED)}; record a motion that excites "
            f"{'it' if len(open_) == 1 else 'them'}."
        )
    small = insignificant_parameters(identification)
    if not open_ and not in_sums and not small:
        found.append("Every parameter is determined.")
    possible = identification.physical_consistency
    if possible.possible:
        found.append("The parameters are physically consistent.")
    elif possible.possible is None:
        why = "; ".join(possible.reasons)
        found.append(f"{why[0].upper()}{why[1:]}.")
    else:
        found.append(
            f"The parameters are not physically consistent: {'; '.join(possible.reasons)}. Use {asked_for('--method consistent')} for parameters that are."
        )
        below = below_zero_said(identification.estimate, identification.training)
        if below is not None:
            found.append(below)
    unsure = of_unknown_std(identification)
    if small:
        every = len(identification.model.names)
        known = every - len(open_) - len(unsure)
        found.append(
            f"{known - len(small)} of {known}{' determined' * (known < every)} parameters differ from zero by more than two standard "
            f"deviations; not {listed(small, MAX_NAMED)}."
        )
    if unsure:
        found.append(
            f"The standard deviation of {listed(unsure, MAX_NAMED)} is not known: almost all information about "
            f"{'it' if len(unsure) == 1 else 'them'} comes from one stretch of time; record longer."
        )
    found.append(weights_said(identification.estimate))
    if identification.estimate.variation:
        found += [f"{said}." for said in identification.estimate.variation.sentences(robot)]
    runs = len(identification.training.data.recordings)
    if runs < MIN_RUNS:
        few = "How runs differ" if runs == 1 else "How runs differ, except for offsets,"
        found.append(
            f"{few} is not known from {NUMBERS[runs]} and is not in the standard deviations: record three or more."
        )
    biased = bias_said(identification.estimate)
    if biased is not None:
        found.append(biased)
    if isinstance(identification.estimate, ConsistentEstimate):
        found += _shapes_said(identification.estimate.shapes)
    return found


def below_zero_said(estimate: Estimate, observations: Observations) -> str | None:
    """Say whether chance makes what lies below zero where no arm's parameter can, or friction that pushes; None where none does.

    Parameters
    ----------
    estimate : Estimate
        Not held to what an arm can have.
    observations : Observations
        That it is of: friction is asked at the speeds in them.
    """
    robot, columns = estimate.model.robot, estimate.model.columns
    below = [k for k, column in enumerate(columns) if column.nonnegative and estimate.value[k] < 0.0]
    size = {k: -estimate.value[k] / estimate.std[k] for k in below if 0.0 < estimate.std[k] < np.inf}
    beyond = {columns[k].name: stds for k, stds in size.items() if stds > BEYOND_CHANCE}
    rubbing = [column for term in estimate.model.terms if isinstance(term, Friction) for column in term.columns]
    for j, push in enumerate(pushes(estimate, observations)):
        own = [column.name for column in rubbing if column.joint == robot.joints[j] and column.name in beyond]
        # Once of each joint, by what is surest.
        if push is not None and push.stds > max((beyond[name] for name in own), default=0.0):
            beyond = {name: stds for name, stds in beyond.items() if name not in own}
            beyond[f"friction of {robot.joints[j]} at {push.speed:.2g} {robot.position_unit(j)}/s"] = push.stds
    if beyond:
        max_first = sorted(beyond, key=lambda name: -beyond[name])
        said = listed([f"{name} by {beyond[name]:.2g} standard deviations" for name in max_first], MAX_NAMED)
        return (
            f"Negative by more than chance: {said}. Something that the model lacks, or an error of the robot "
            f"description, biases them and perhaps other parameters; the standard deviations do not include this bias, "
            f"and the method consistent hides it: diagnose the recordings."
        )
    if not size:
        return None
    most = max(size, key=lambda k: size[k])
    return (
        f"Negative, which is impossible for a real arm: {columns[most].name} by {size[most]:.2g} standard deviations; "
        f"with so many parameters up to {BEYOND_CHANCE:g} may be chance."
    )


def weights_said(estimate: Estimate) -> str:
    """Say how much each joint counts."""
    robot = estimate.model.robot
    if np.all(estimate.weights == estimate.weights[0]):
        return f"Every row of every joint counts the same ({estimate.method})."
    noise = [
        f"{1.0 / weight:.3g} {robot.torque_unit(j)} ({joint})"
        for j, (joint, weight) in enumerate(zip(robot.joints, estimate.weights, strict=True))
    ]
    return f"Each joint is weighted by its residual ({estimate.method}): {', '.join(noise)}."


def bias_of(estimate: Estimate) -> dict[str, float]:
    """Return by how much the noise of positions moves each parameter; nothing where it is negligible."""
    names, bias = estimate.model.names, estimate.noise_bias
    return {} if bias is None else dict(zip(names, bias.tolist(), strict=True))


def bias_said(estimate: Estimate) -> str | None:
    """Say which parameters the noise of positions biases by more than their other uncertainty; None where none."""
    if estimate.noise_bias is None:
        return None
    said = bias_sentence(estimate.model.names, estimate.noise_bias, estimate.std)
    return said and f"{said[0].upper()}{said[1:]}."


def _shapes_said(choices: Sequence[ShapeChoice]) -> list[str]:
    """Say what friction was held to on which joints, and why."""
    groups: dict[tuple[str, str], list[str]] = {}
    for choice in choices:
        tested = "" if choice.p_value is None else f" (p = {choice.p_value:.2g})"
        groups.setdefault((choice.shape, choice.why), []).append(f"{choice.joint}{tested}")
    return [
        f"Friction is {shape} ({SHAPES[shape]}) on {listed(joints, MAX_NAMED)}: {why}."
        for (shape, why), joints in groups.items()
    ]
