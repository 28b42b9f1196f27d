"""Are the channels what the mapping says? Opposite signs and exchanged joints imitate every effect, so they come first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation import Estimate
from scara_ident.estimation.information import merge
from scara_ident.estimation.least_squares import weighted_value, wls
from scara_ident.estimation.observations import Evidence, gather_all
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Friction
from scara_ident.motion.motion import motion_of, stretches
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]
Signal = Literal["effort", "position", "effort and position"]

# Another mapping must leave at most this share of the error, geometric mean over the joints.
MENDED = 0.5
# Joints whose error is above this share of their torque may be exchanged with another.
POOR = 0.05
# An axis turned round leaves more than this of some joint's torque.
TURNED = 0.08
# Exchanging one signal alone makes nonsense of both joints.
BAD = 0.3
# Friction that feeds in this share of a joint's power, and this many standard deviations, points to a sign.
PUSHING = 0.02
PUSHING_STD = 4.0


@dataclass(frozen=True)
class MappingFault:
    """Another reading of the channels that fits far better.

    Attributes
    ----------
    signal : {"effort", "position", "effort and position"}
    joints : tuple of str
        Those whose sign is opposite, or the two that are exchanged.
    exchanged : bool
    error, mended : float
        Rms of what is left as a share of the torque, geometric mean over the joints, as mapped and as it should be.
    """

    signal: Signal
    joints: tuple[str, ...]
    exchanged: bool
    error: float
    mended: float

    def __str__(self) -> str:
        """Say what, and what to do."""
        gain = f"what is left of the torque falls from {100 * self.error:.2g} to {100 * self.mended:.2g} %"
        names = (" and " if self.exchanged else ", ").join(self.joints)
        if self.exchanged:
            return (
                f"{self.signal} of {names} look exchanged: the other way round {gain}; exchange their columns under "
                f"recording: in robot.yaml"
            )
        if self.mended > MENDED * self.error:
            return (
                f"{names}: the effort, or the position, has the opposite sign: on every joint friction would feed energy "
                "in; negate effort_gain in robot.yaml"
            )
        turn = {
            "effort": f"negate effort_gain of {names} in robot.yaml",
            "position": f"negate the axis of {names} in the URDF, or give its position scale: -1 in robot.yaml",
            "effort and position": f"negate the axis of {names} in the URDF",
        }[self.signal]
        verb = "look" if self.signal == "effort and position" else "looks"
        return f"{self.signal} of {names} {verb} like the opposite sign: turned round {gain}; {turn}"


def mapping_faults(
    model: TorqueModel, recordings: Sequence[Recording], bands: Sequence[float | None]
) -> tuple[MappingFault, ...]:
    """Find efforts and positions of opposite sign, and those of two joints that are exchanged.

    A sign is suspected where friction would feed energy in, an exchange where two joints are hardly explained; only
    then are other readings tried. One counts if it leaves at most half of the error and the friction brakes.

    Parameters
    ----------
    model : TorqueModel
    recordings : sequence of Recording
        With effort; the first run of every trajectory is used.
    bands : sequence of float or None, one per joint

    Returns
    -------
    tuple of MappingFault
        To be mended together; empty where nothing else fits better.
    """
    data = tuple({item.trajectory: item for item in reversed(recordings)}.values())
    joints = model.robot.joints
    faults: list[MappingFault] = []
    for _ in range(2 * len(joints)):
        evidence = gather_all(model, data, bands)
        fitted = wls(model, evidence)
        errors, score = _relative(fitted.value, evidence), _score(fitted.value, evidence)
        pushing = _pushing(fitted, data, bands)
        best: tuple[MappingFault, tuple[Recording, ...]] | None = None
        for signal, chosen, exchanged in _suspects(errors, pushing):
            other = tuple(_read_as(item, signal, chosen, exchanged) for item in data)
            held = gather_all(model, other, bands)
            mended = _score(weighted_value(model, held), held)
            if mended >= (MENDED * score if best is None else best[0].mended):
                continue
            # A turned sign must take the push away; signs that an exchange brings to light are the next round's.
            allowed = np.count_nonzero(pushing) - (signal != "effort and position")
            if not exchanged and np.count_nonzero(_pushing(wls(model, held), other, bands)) > allowed:
                continue
            names = tuple(joints[j] for j in chosen)
            best = MappingFault(signal, names, exchanged, score, mended), other
        if best is not None:
            faults.append(best[0])
            data = best[1]
            continue
        if np.all(pushing) and _net_power(data) < 0.0:
            faults.append(MappingFault("effort", tuple(joints), False, score, score))
        break
    return tuple(faults)


def _suspects(errors: Array, pushing: NDArray[np.bool_]) -> list[tuple[Signal, tuple[int, ...], bool]]:
    """Return readings worth trying: the signal, its joints, and whether they are exchanged or turned round."""
    one: tuple[Signal, ...] = ("effort", "position")
    both: Signal = "effort and position"
    poor = [int(j) for j in np.flatnonzero(errors > POOR)]
    found: list[tuple[Signal, tuple[int, ...], bool]] = []
    found += [(signal, (int(j),), False) for j in np.flatnonzero(pushing) for signal in one]
    if np.any(errors > TURNED) and not np.any(pushing):
        found += [(both, (j,), False) for j in range(len(errors))]
    for pair in combinations(poor, 2):
        found.append((both, pair, True))
        if np.all(errors[list(pair)] > BAD):
            found += [(signal, pair, True) for signal in one]
    return found


def _read_as(recording: Recording, signal: Signal, joints: Sequence[int], exchanged: bool) -> Recording:
    """Return the recording with a signal of one joint negated, or of two exchanged."""
    order = list(range(len(recording.joints)))
    sign = np.ones((len(order), 1))
    if exchanged:
        order[joints[0]], order[joints[1]] = joints[1], joints[0]
    else:
        sign[joints[0]] = -1.0
    effort, position = recording.effort, recording.position
    assert effort is not None
    if signal == "effort":
        return replace(recording, effort=sign * effort[order])
    # What is derived from position would contradict it.
    position = sign * position[order]
    effort = effort if signal == "position" else sign * effort[order]
    return replace(recording, position=position, effort=effort, velocity=None, acceleration=None)


def _net_power(data: Sequence[Recording]) -> float:
    """Return the energy that the efforts feed into the arm over recordings, up to the reductions' scale."""
    return float(sum(np.sum(item.effort[:, 1:] * np.diff(item.position)) for item in data if item.effort is not None))


def _relative(value: Array, evidence: Sequence[Evidence]) -> Array:
    joints = [merge(item.joint(j) for item in evidence) for j in range(len(evidence[0].unfiltered))]
    return np.array([part.rms(value) / max(part.torque_rms, np.finfo(float).tiny) for part in joints])


def _score(value: Array, evidence: Sequence[Evidence]) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(_relative(value, evidence), 1e-12)))))


def _pushing(estimate: Estimate, data: Sequence[Recording], bands: Sequence[float | None]) -> NDArray[np.bool_]:
    """Return the joints whose estimated friction feeds energy in over the recorded motion, beyond its uncertainty."""
    model = estimate.model
    robot = model.robot
    result = np.zeros(robot.n, dtype=bool)
    start = 0
    for term in model.terms:
        stop = start + len(term.columns)
        if isinstance(term, Friction):
            power, passed, count = np.zeros((robot.n, stop - start)), np.zeros(robot.n), 0
            for recording in data:
                part = max(stretches(recording), key=lambda item: len(item.time))
                motion = motion_of(part, bands)
                torque = part.torque if part.torque is not None else np.zeros_like(motion.v)
                drive = robot.drive_sign[:, None] * motion.v
                power += np.einsum("jpn,jn->jp", term.regressor(motion), drive)
                passed += np.sum(np.abs(torque * drive), axis=1)
                count += motion.samples
            value = power @ estimate.value[start:stop]
            std = np.sqrt(np.einsum("jp,pq,jq->j", power, estimate.covariance[start:stop, start:stop], power))
            result |= (value < -PUSHING * passed) & (value < -PUSHING_STD * std)
        start = stop
    return result
