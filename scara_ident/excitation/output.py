"""Designed trajectories as files: CSV for controllers, YAML for ROS 2, and what is known of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.estimation.information import Information
from scara_ident.excitation.criteria import BlockLogDet, Condition
from scara_ident.excitation.curves import Basis, ExcitationTrajectory
from scara_ident.excitation.design import Design, information_of
from scara_ident.excitation.limits import scara03_friction
from scara_ident.excitation.stopping import Stopping
from scara_ident.files import write_text
from scara_ident.inquiry.next_steps import capital
from scara_ident.recording.files.parquet_csv import write_columns

RATE = 1000.0
# Points of a JointTrajectory are splined by the controller that gets them: this many per second, and at least so
# many per period of the highest harmonic.
ROS_RATE = 100.0
ROS_POINTS = 10.0
# Samples per period of the highest harmonic below which a table no longer tells the motion.
MIN_SAMPLES = 4.0
# Joints or limits that a sentence names, at the most.
MAX_NAMES = 6
# Motion above this frequency makes most arms swing, Hz.
SWINGING = 5.0
# Samples per second at which the torque of guessed rotors is looked at: an order of magnitude needs no more.
PREVIEW_RATE = 100.0


def file_names(design: Design, suffix: str) -> tuple[str, ...]:
    """Return a file name for every trajectory: ``trajectory.csv``, then ``trajectory-b.csv`` and so on."""
    return tuple(
        f"trajectory{'' if k == 0 else '-' + chr(ord('a') + k)}{suffix}" for k in range(len(design.trajectories))
    )


def write_trajectory(trajectory: ExcitationTrajectory, path: Path | str, rate: float = RATE) -> None:
    """Write ``time`` and position, velocity and acceleration of every joint, both ends included.

    Parameters
    ----------
    trajectory : ExcitationTrajectory
    path : path
        A ``.csv`` or ``.parquet`` file.
    rate : float
        Samples per second; if the duration is no multiple of the sample time, the nearest rate for which it is.

    Raises
    ------
    UsageError
        If the rate is too low for the motion.
    RecordingError
        If the file cannot be written.
    """
    columns = trajectory_columns(trajectory, rate)
    path = Path(path)
    _make_folder(path)
    write_columns(path, columns)


def trajectory_columns(trajectory: ExcitationTrajectory, rate: float) -> dict[str, Array]:
    """Return ``time`` and position, velocity and acceleration of every joint at about a rate, each of shape (N,)."""
    time = sample_times(trajectory, rate)
    columns = {"time": time}
    for name, *signals in zip(trajectory.joints, *trajectory.at(time), strict=True):
        for kind, signal in zip(("position", "velocity", "acceleration"), signals, strict=True):
            columns[f"{name}.{kind}"] = signal
    return columns


def sample_times(trajectory: ExcitationTrajectory, rate: float) -> Array:
    """Return equally spaced times from 0 to the duration at about a rate, s."""
    check_rate(rate, trajectory.basis.bandwidth)
    return np.linspace(0.0, trajectory.duration, round(trajectory.duration * rate) + 1)


def check_rate(rate: float, bandwidth: float) -> None:
    """Refuse a rate that cannot tell a motion of this bandwidth; both in Hz.

    Raises
    ------
    UsageError
        In one line.
    """
    least = MIN_SAMPLES * bandwidth
    if not rate >= least:
        raise UsageError(
            f"rate {rate:g} Hz: this motion reaches {bandwidth:g} Hz and needs at least {least:g} Hz; "
            "use fewer harmonics, or a higher rate"
        )


def joint_trajectory_yaml(trajectory: ExcitationTrajectory, rate: float | None = None) -> str:
    """Return a ROS 2 ``trajectory_msgs/msg/JointTrajectory`` as YAML, as ``ros2 topic pub`` takes it.

    Without a rate 100 points a second, more where the motion needs them.
    """
    if rate is None:
        rate = max(ROS_RATE, ROS_POINTS * trajectory.basis.bandwidth)
    time = sample_times(trajectory, rate)
    q, v, a = trajectory.at(time)
    lines = [
        "header:",
        "  stamp: {sec: 0, nanosec: 0}",
        "  frame_id: ''",
        f"joint_names: [{', '.join(json.dumps(str(name)) for name in trajectory.joints)}]",
        "points:",
    ]
    for k, t in enumerate(time):
        seconds, rest = divmod(round(t * 1e9), 1_000_000_000)
        lines += [
            f"- positions: {_numbers(q[:, k])}",
            f"  velocities: {_numbers(v[:, k])}",
            f"  accelerations: {_numbers(a[:, k])}",
            "  effort: []",
            f"  time_from_start: {{sec: {seconds}, nanosec: {rest}}}",
        ]
    return "\n".join(lines) + "\n"


def write_joint_trajectory(trajectory: ExcitationTrajectory, path: Path | str, rate: float | None = None) -> None:
    """Write a ROS 2 ``JointTrajectory``; see `joint_trajectory_yaml`."""
    write_text(Path(path), joint_trajectory_yaml(trajectory, rate))


def excitation_dict(design: Design, stopping: Stopping | None = None) -> dict[str, Any]:
    """Return the content of ``excitation.json``.

    Parameters
    ----------
    stopping : Stopping, optional
        When more recordings no longer pay, where a std is asked.

    Returns
    -------
    dict
        Plain values; infinite numbers where something is not known.
    """
    longest = max(design.trajectories, key=lambda each: each.duration)
    basis, effort = longest.basis, design.effort
    scaled = scaled_condition(design.unweighted)
    criterion: dict[str, Any] = {"name": "tell" if design.tells else design.criterion.name}
    columns = design.criterion.columns if isinstance(design.criterion, (BlockLogDet, Condition)) else None
    if columns is not None:
        criterion["parameters"] = [design.model.names[k] for k in columns]
    finite = [cost for cost in design.costs if np.isfinite(cost)]
    return {
        "summary": [*summary(design), *([] if stopping is None else [stopping.words()])],
        "notes": notes(design),
        "robot": design.model.robot.name,
        "model": design.model.name,
        "criterion": criterion,
        **({"tells": [item.entry() for item in design.tells]} if design.tells else {}),
        "log_det": design.log_det,
        "condition": design.condition,
        "condition_of_regressor": float(np.sqrt(design.condition)),
        "condition_of_scaled_regressor": scaled,
        "log_det_with_prior": None if design.prior is None else design.total.log_det(),
        "duration": basis.duration,
        "samples": design.samples[0] if len(set(design.samples)) == 1 else list(design.samples),
        "family": basis.family,
        "harmonics": _harmonics(basis),
        "intervals": basis.orders[0] if basis.family == "spline" else None,
        "bandwidth_hz": basis.bandwidth,
        "limits": {
            each.name: {"bound": each.bound, "reached": each.reached, "unit": each.unit, "share": each.share}
            for each in design.reached
        },
        **_distances(design),
        **({} if stopping is None else {"stopping": stopping.entry()}),
        "active_limits": [each.name for each in design.reached if each.active],
        "verified_samples": design.verified,
        "noise_weights": design.model.robot.by_joint(design.weights.tolist()),
        "parameters": [
            {"name": column.name, "joint": column.joint, "unit": column.unit, "std": float(std)}
            for column, std in zip(design.model.columns, design.std(), strict=True)
        ],
        "trajectories": [
            {
                "name": each.name,
                "file": file,
                "duration": each.duration,
                "log_det": alone.log_det(),
                "condition": alone.condition(),
                "joints": dict(zip(each.joints, each.series(), strict=True)),
            }
            for each, samples, file in zip(design.trajectories, design.samples, file_names(design, ".csv"), strict=True)
            for alone in [information_of(design.model, each, samples)]
        ],
        "search": {
            "seed": effort.seed,
            "starts": effort.starts,
            "rounds": effort.rounds,
            "failed": len(design.costs) - len(finite),
            "cost_best": min(finite),
            "cost_median": float(np.median(finite)),
        },
    }


def _distances(design: Design) -> dict[str, Any]:
    """Return the smallest distances with the one asked for, and the obstacles, where there are shapes."""
    clearance = design.limits.clearance
    if clearance is None or not clearance.pairs:
        return {}
    kept = {each.name.removeprefix("distance."): each.reached for each in design.reached if "distance." in each.name}
    boxes = [{"centre": list(centre), "edges": list(edges)} for centre, edges in clearance.boxes]
    return {
        "distances": kept,
        "clearance": clearance.margin,
        "obstacles": {"floor": clearance.floor if np.isfinite(clearance.floor) else None, "boxes": boxes},
    }


def summary(design: Design) -> list[str]:
    """Say in a few sentences what was designed."""
    count = len(design.trajectories)
    what = "A trajectory" if count == 1 else f"{count} trajectories"
    held = [each.name for each in design.reached if each.active]
    broken = [each.name for each in design.reached if not each.kept]
    lengths = _listed([each.duration for each in design.trajectories])
    samples = _listed(list(design.samples))
    each = "" if count == 1 or len(set(design.samples)) > 1 else " each"
    return [
        f"{what} of {lengths} s for {_few(design.model.robot.joints, 'joint')}.",
        f"Limits broken: {', '.join(broken)}."
        if broken
        else f"All limits hold, at {design.verified} samples and between them.",
        *(f"{capital(item.question.text)}: {item.words}" for item in design.tells),
        f"Limits that are reached: {_few(held, 'limit')}." if held else "No limit is reached: use more harmonics.",
        f"Information of the regressor H over {samples} samples{each}: J_d = ln det H^T H {design.log_det:.2f}, "
        f"J_k = cond H^T H {design.condition:.4g}.",
    ]


def _few(names: Sequence[str], noun: str) -> str:
    """Return names, or how many there are where nobody would read them all."""
    return ", ".join(names) if len(names) <= MAX_NAMES else f"{len(names)} {noun}s"


def _listed(numbers: Sequence[float]) -> str:
    """Return one number where all are the same, else all."""
    words = [f"{number:g}" for number in (numbers[:1] if len(set(numbers)) == 1 else numbers)]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def notes(design: Design) -> list[str]:
    """Say what the design rests on."""
    clearance = design.limits.clearance
    said = list(clearance.notes) if clearance is not None else ["Collisions were not checked: run it slowly first."]
    if np.any(np.isfinite(design.limits.torque)):
        said.append(_foreseen(design))
    bandwidth = max(each.basis.bandwidth for each in design.trajectories)
    if bandwidth > SWINGING:
        said.append(
            f"The motion reaches {bandwidth:g} Hz, where many arms oscillate: use fewer harmonics if yours does."
        )
    if not design.trajectories[0].basis.periodic:
        said.append("The motion does not end where it starts.")
    return said


def _foreseen(design: Design) -> str:
    model = design.model
    foreseen = "Torques were predicted with the URDF's bodies and rotors"
    if not np.any(np.delete(design.nominal, np.r_[model.place(model.rigid_body)])):
        if lacking := _rotors_left_out(design):
            foreseen = f"Torques were predicted with the URDF's bodies, without {lacking}"
        return f"{foreseen}, without friction: identify once, and give the result with {asked_for('--parameters', 'known')}."
    own = scara03_friction(model.robot)
    if own and all(own[name] == value for name, value in zip(model.names, design.nominal, strict=True) if name in own):
        return f"{foreseen} and the friction of the paper's Table 5 (OJD)."
    return f"{foreseen}, or with better values where known, and with the friction given."


def _rotors_left_out(design: Design) -> str:
    """Name the rotors that nobody stated, and what as large ones as motors of their size have would make of a torque."""
    model, robot = design.model, design.model.robot
    guessed = np.where(robot.rotor_stated, 0.0, robot.rotor_guess.armature)
    if not np.any(guessed):
        return ""
    body = model.rigid_body
    added = (body.base.grouping @ np.concatenate([np.zeros(10 * robot.n), guessed]))[body.kept]
    heavier = design.nominal.copy()
    heavier[model.place(body)] += added
    runs = [replace(design, nominal=heavier).motion(k, PREVIEW_RATE) for k in range(len(design.trajectories))]
    peak = np.max([np.max(np.abs(run.torque), axis=1) for run in runs if run.torque is not None], axis=0)
    worst = int(np.argmax(np.where(guessed > 0.0, peak / design.limits.torque, 0.0)))
    joints = _few([joint for joint, own in zip(robot.joints, guessed, strict=True) if own > 0.0], "joint")
    return (
        f"the rotors of {joints}, which are not stated (with typical rotors of such motors, {robot.joints[worst]} "
        f"would reach about {peak[worst]:.2g} {robot.torque_unit(worst)} of {design.limits.torque[worst]:.2g})"
    )


def _harmonics(basis: Basis) -> int | list[int] | None:
    if basis.family != "fourier":
        return None
    count = len(basis.orders)
    return count if basis.orders[-1] == count else list(basis.orders)


def scaled_condition(information: Information) -> float:
    """Return the condition of the regressor with columns scaled to unit length; inf without full rank."""
    factor = information.regressor_factor
    size = np.linalg.norm(factor, axis=0)
    if np.any(size == 0.0):
        return np.inf
    singular = np.linalg.svd(factor / size, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf


def _numbers(values: Array) -> str:
    return "[" + ", ".join(f"{value:.9g}" if value % 1.0 else f"{value:.1f}" for value in values) + "]"


def _make_folder(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScaraIdentError(f"{path.parent}: cannot be made: {error.strerror or error}") from error
