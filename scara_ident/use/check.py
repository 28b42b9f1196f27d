"""Whether a motion can be run, by the torque that an identified model predicts for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError, UsageError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.manners import listed
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.motion.recorded_range import faster_than_recorded
from scara_ident.recording.files import column_names
from scara_ident.recording.recording import read_recording
from scara_ident.simulation.reference import read_trajectory
from scara_ident.use.energy import Drive, Energy, drive, energy_of
from scara_ident.use.joint_limits import JointLimits, Margin, margins

# A margin below so many standard deviations of the foreseen torque is close; a peak is unsure where they are above this
# share of it.
CLOSE_STDS, UNSURE_SHARE = 2.0, 0.1
# Slowest share of the speed that is tried, and how finely the largest that can be run is found.
MIN_SPEED_SHARE, BISECTIONS = 0.02, 14
# Limits or joints in a sentence, at the most.
MAX_NAMED = 6
# Samples at which slower motions are looked at.
MAX_SAMPLES = 5000


@dataclass(frozen=True)
class Peak:
    """The largest torque of a joint, recorded side, N m or N.

    Attributes
    ----------
    joint : str
    torque : float
        With its sign.
    time : float
        s.
    model_std : float
        By how much the parameters leave it open: one standard deviation.
    std : float
        That, with the model's rms error on recordings, which is what measurement, controller and all that the model lacks
        made there.
    unit : str
    """

    joint: str
    torque: float
    time: float
    model_std: float
    std: float
    unit: str


@dataclass(frozen=True, eq=False)
class Check:
    """What a motion takes of the drives and reaches of the limits.

    Attributes
    ----------
    known : IdentifiedModel
    limits : JointLimits
    drives : tuple of Drive
        The motion, stretch by stretch, with its torque.
    margins : tuple of Margin
    peaks : tuple of Peak
        A joint each.
    energy : Energy
    """

    known: IdentifiedModel
    limits: JointLimits
    drives: tuple[Drive, ...]
    margins: tuple[Margin, ...]
    peaks: tuple[Peak, ...]
    energy: Energy

    @property
    def name(self) -> str:
        """Of the motion."""
        return self.drives[0].motion.name

    @property
    def broken(self) -> tuple[Margin, ...]:
        """Limits that do not hold, the worst first."""
        return tuple(sorted((each for each in self.margins if not each.kept), key=lambda each: -each.excess))

    @property
    def limited_by(self) -> Margin | None:
        """The limit that is exceeded most, else the one that is used most; None where there is no limit."""
        return self.broken[0] if self.broken else max(self.margins, key=lambda each: each.excess, default=None)

    @cached_property
    def speed_share(self) -> float | None:
        """Largest share of the speed, along the same path, at which all limits hold; None where none that was tried does."""
        if not self.broken:
            return 1.0
        return None if self.broken_slowly else _speed_share(self.known, self.limits, self.drives)

    @cached_property
    def broken_slowly(self) -> tuple[Margin, ...]:
        """Limits that do not hold at the slowest speed that is tried either."""
        return _broken_at(MIN_SPEED_SHARE, self.known, self.limits, _thinned(self.drives))

    @cached_property
    def recorded_rms(self) -> Array | None:
        """Rms of recorded less foreseen torque, shape (n,); None where no effort was recorded."""
        left = [each.motion.torque - each.torque for each in self.drives if each.motion.torque is not None]
        return np.asarray(np.sqrt(np.mean(np.concatenate(left, axis=1) ** 2, axis=1))) if left else None


def read_motion(path: Path | str, known: IdentifiedModel) -> tuple[Motion, ...]:
    """Read a motion as stretches without gaps.

    Parameters
    ----------
    path : path
        A ``trajectory.csv`` with position, velocity and acceleration, which is taken as it is; or a recording, whose
        positions are low-passed and differentiated as they were for the identification.
    known : IdentifiedModel

    Raises
    ------
    UsageError
        If there is no such file.
    RecordingError
        If it cannot be read, or is too short.
    """
    path, robot = Path(path), known.robot
    if not path.exists():
        raise UsageError(f"{path}: no such file; give a trajectory.csv or a recording")
    names = (
        set() if path.is_dir() else set(column_names(path)) if path.suffix.lower() in (".csv", ".parquet") else set()
    )
    wanted = {f"{joint}.{kind}" for joint in robot.joints for kind in ("position", "velocity", "acceleration")}
    if wanted <= names and not any(f"{joint}.effort" in names for joint in robot.joints):
        planned = read_trajectory(path, robot)
        step = np.diff(planned.time)
        if len(planned.time) < 2 or not np.all(step > 0.0):
            raise RecordingError(f"{path}: time is not strictly increasing; give a trajectory of two samples or more")
        signals = (planned.position, planned.velocity, planned.acceleration)
        return (Motion(planned.name, planned.name, planned.time, *signals, None, 1.0 / float(np.median(step))),)
    recording = read_recording(path, robot, need_effort=False)
    found = []
    for part in prepare([recording], known.bands).stretches:
        # What lies beyond the ends of a recording is a guess, and the derivatives there with it.
        inside = part.motion.part(part.trim, part.samples - part.trim)
        if inside.samples > 1:
            found.append(replace(inside, time=inside.time - recording.time[0]))
    if not found:
        raise RecordingError(f"{path}: too short for the band of the identification; give a longer recording")
    return tuple(found)


def check(known: IdentifiedModel, motions: Sequence[Motion], limits: JointLimits) -> Check:
    """Foresee torque, power and energy of a motion, and compare them with limits.

    At a standstill friction is left out: it may take or give up to Coulomb's.

    Parameters
    ----------
    known : IdentifiedModel
    motions : sequence of Motion, at least one
        Stretches of one motion.
    limits : JointLimits
    """
    drives = tuple(drive(known, motion) for motion in motions)
    return Check(known, limits, drives, margins(known.robot, limits, drives), _peaks(known, drives), energy_of(drives))


def _peaks(known: IdentifiedModel, drives: Sequence[Drive]) -> tuple[Peak, ...]:
    time = np.concatenate([each.motion.time for each in drives])
    torque = np.concatenate([each.torque for each in drives], axis=1)
    open_ = np.concatenate([known.torque_std(each.motion) for each in drives], axis=1)
    found = []
    for j, (joint, k) in enumerate(zip(known.robot.joints, np.argmax(np.abs(torque), axis=1), strict=True)):
        # An error that is not known is left out.
        std = float(np.hypot(open_[j, k], np.nan_to_num(known.rms[j])))
        unit = known.robot.torque_unit(j)
        found.append(Peak(joint, float(torque[j, k]), float(time[k]), float(open_[j, k]), std, unit))
    return tuple(found)


def slowed(motion: Motion, share: float) -> Motion:
    """Return a motion along the same path at a share of its speed."""
    return replace(
        motion,
        time=motion.time / share,
        v=share * motion.v,
        a=share**2 * motion.a,
        rate=share * motion.rate,
        torque=None,
    )


def _speed_share(known: IdentifiedModel, limits: JointLimits, drives: Sequence[Drive]) -> float:
    """Return the largest share of the speed at which all limits hold, where the slowest is known to be one."""
    motions = _thinned(drives)
    low, high = MIN_SPEED_SHARE, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _broken_at(middle, known, limits, motions) else (middle, high)
    return low


def _broken_at(
    share: float, known: IdentifiedModel, limits: JointLimits, motions: Sequence[Motion]
) -> tuple[Margin, ...]:
    """Return the limits that do not hold at a share of the speed."""
    slower = [drive(known, slowed(motion, share)) for motion in motions]
    return tuple(each for each in margins(known.robot, limits, slower) if not each.kept)


def _thinned(drives: Sequence[Drive]) -> list[Motion]:
    every = max(1, sum(each.motion.samples for each in drives) // MAX_SAMPLES)
    return [_every(each.motion, every) for each in drives]


def _every(motion: Motion, step: int) -> Motion:
    q, v, a = (signal[:, ::step] for signal in (motion.q, motion.v, motion.a))
    return replace(motion, time=motion.time[::step], q=q, v=v, a=a, torque=None, rate=motion.rate / step)


def check_dict(found: Check) -> dict[str, Any]:
    """Return the content of ``check.json``."""
    robot, energy, limiting = found.known.robot, found.energy, found.limited_by
    time = [each.motion.time for each in found.drives]
    return {
        "summary": sentences(found),
        "robot": robot.name,
        "model": found.known.model.name,
        "trajectory": found.name,
        "duration": float(sum(part[-1] - part[0] for part in time)),
        "runs": not found.broken,
        "limited_by": None if limiting is None else _entry(limiting),
        "speed_share": found.speed_share,
        "limits": {each.name: _entry(each) for each in found.margins},
        "peaks": {
            each.joint: {key: getattr(each, key) for key in ("torque", "time", "model_std", "std")}
            for each in found.peaks
        },
        "model_error": robot.by_joint(found.known.rms),
        "recorded_minus_foreseen": None if found.recorded_rms is None else robot.by_joint(found.recorded_rms),
        "energy": {
            joint: {
                "given": energy.given[j],
                "returned": energy.returned[j],
                "heat": energy.heated[j],
                "work": {name: work[j] for name, work in energy.work.items() if work[j]},
                "rms_torque": energy.rms_torque[j],
                "peak_power": float(max(np.max(each.power[j]) for each in found.drives)),
                "peak_braking_power": float(max(0.0, *(np.max(-each.power[j]) for each in found.drives))),
            }
            for j, joint in enumerate(robot.joints)
        },
        "heat_parts": list(energy.heat),
        "units": {"energy": "J", "power": "W", "torque": [robot.torque_unit(j) for j in range(robot.n)]},
    }


def _entry(each: Margin) -> dict[str, Any]:
    keys = ("joint", "kind", "time", "bound", "reached", "margin", "share", "unit", "beyond")
    return {key: getattr(each, key) for key in keys}


def sentences(found: Check) -> list[str]:
    """Say in a few sentences whether the motion can be run, what limits it, and what it costs."""
    said, energy = [], found.energy
    worst = found.limited_by
    if worst is None:
        said.append("No limit is known, so none is exceeded.")
    else:
        near = f"{_named(worst)} at {worst.time:.3f} s: {worst.reached:.4g} of {worst.bound:.4g} {worst.unit}"
        said.append(f"It cannot be run: {near}." if found.broken else f"It can be run. Nearest to its limit is {near}.")
    if found.broken:
        share = found.speed_share
        said.append(
            f"Even at {MIN_SPEED_SHARE:g} of the speed it cannot be run: {_still_beyond(found)}."
            if share is None
            else f"Along the same path it can be run at {share:.3g} of the speed."
        )
        others = [f"{each.name} at {each.time:.3f} s" for each in found.broken[1:]]
        if others:
            said.append(f"Also beyond their limits: {listed(others, MAX_NAMED)}.")
    close = _close(found)
    if close:
        said.append(f"Within two standard deviations of their torque limit: {', '.join(each.name for each in close)}.")
    unsure = [
        f"{each.joint} ({each.torque:.3g} ± {CLOSE_STDS * each.std:.2g} {each.unit})"
        for each in found.peaks
        if CLOSE_STDS * each.std > UNSURE_SHARE * abs(each.torque)
    ]
    if unsure:
        said.append(
            f"The largest torque is uncertain by more than a tenth (two standard deviations) on {listed(unsure, MAX_NAMED)}."
        )
    speed = np.max([np.max(np.abs(each.motion.v), axis=1) for each in found.drives], axis=0)
    if faster := faster_than_recorded(found.known.reached, speed, found.known.robot):
        said.append(faster)
    said.append(
        f"The drives give {energy.given.sum():.4g} J and take {energy.returned.sum():.4g} J back; "
        f"{energy.heated.sum():.4g} J become heat in the joints."
    )
    return said


def _still_beyond(found: Check) -> str:
    names = list(dict.fromkeys(_named(each) for each in found.broken_slowly))
    return f"{listed(names, MAX_NAMED)} {'is still beyond its limit' if len(names) == 1 else 'are still beyond their limits'}"


def _close(found: Check) -> list[Margin]:
    std = {each.joint: each.std for each in found.peaks}
    return [each for each in found.margins if each.kind == "torque" and abs(each.margin) < CLOSE_STDS * std[each.joint]]


def _named(each: Margin) -> str:
    return f"{each.kind.partition('.')[0]} of {each.joint}"


def limits_of_joint(limits: JointLimits, joint: int) -> dict[str, tuple[float, float]]:
    """Return lower and upper limit of a joint's signals by name, infinite where there is none."""
    both = {
        kind: (-float(bound[joint]), float(bound[joint]))
        for kind, bound in (
            ("velocity", limits.velocity), ("acceleration", limits.acceleration), ("torque", limits.torque),
            ("power", limits.power),
        )
    }  # fmt: skip
    return {"position": (float(limits.lower[joint]), float(limits.upper[joint])), **both}
