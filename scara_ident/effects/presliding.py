"""Dry friction that builds up over a distance after every reversal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.filters.smoothed_positions import SmoothedPositions
from scara_ident.effects.friction import not_all_of_coulomb
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, View, deviation
from scara_ident.effects.signals import Scene, Signals

# Distances tried, rad: three times apart, which refinement bridges, over what joints have.
DISTANCES = (0.0004, 0.0012, 0.004, 0.012, 0.036)
# Of a joint that slides shorter ones too, as multiples of `Scene.radian`: rolling guides slide after some micrometres, and their
# travel may be a few millimetres or some metres.
SLIDE_DISTANCES = (0.000015, 0.000045, 0.000134, *DISTANCES)
# A distance above this share of the travel is a spring rather than friction.
LONGEST_SHARE = 0.15
# Friction in the state is at least this many times what slides, or it is something else.
SMALLEST_COULOMB_SHARE = 0.4
# It cannot be more than this many times what slides.
LARGEST_COULOMB_SHARE = 1.5
# Reversals shorter than this share of the distance change the state by less, and are noise of the position.
SMALLEST_REVERSAL_SHARE = 0.02


class Presliding(Effect):
    """Coulomb friction that follows a state z instead of sign(v) (Dahl 1968).

    ``dz/dq = (1 - z sign(v))/presliding_distance``. The base model keeps ``a0 sign(v)``; the column is ``z - sign(v)``
    and its coefficient is close to a0. The state begins at zero because the earlier motion is not known; its influence
    ends after a few distances.
    """

    name = "presliding"
    summary = "Coulomb friction that builds up over a distance after a reversal (presliding)"
    coefficients = (
        Coefficient(
            "presliding", "{torque}", "Coulomb friction of {joint} that builds up over a distance",
            "friction would be largest directly after a reversal",
        ),
    )  # fmt: skip
    # Fits scatter evenly about it, and not about its logarithm.
    nonlinear = (
        NonlinearParameter("presliding_distance", "{position}", 1e-5, 0.3, of_length=True, symmetric_power=1.0),
    )
    in_small_ways = True
    imitated_by = (SmoothedPositions(),)
    view = View("reversal", along=True, distance="presliding_distance")
    experiment = "reverse often with small amplitude at two speeds: presliding depends on the distance travelled, a delay on time"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return distances that the joint's travel holds many times."""
        distances = SLIDE_DISTANCES if scene.robot.prismatic[joint] else DISTANCES
        tried = (float(scene.radian[joint] * x) for x in distances)
        return ((x,) for x in tried if x <= LONGEST_SHARE * scene.travel[joint])

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``z - sign(v)`` in the drive's direction."""
        j = member.place
        z = dahl_state(signals.motion.q[j], member.nonlinear[0])
        return [signals.scene.robot.drive_sign[j] * z - signals.sign[j]]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where what builds up is not what then slides."""
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is not None:
            return wrong
        if member.nonlinear[0] > LONGEST_SHARE * scene.travel[member.place]:
            return "over so long a distance it is a spring, not friction"
        return not_all_of_coulomb(
            scene, member.place, value, std, "over a distance", SMALLEST_COULOMB_SHARE, LARGEST_COULOMB_SHARE
        )

    def turns_on(self, member: Member) -> tuple[float, float]:
        """Return the distance: where a reversal is must be known better."""
        return member.nonlinear[0], np.inf

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the friction that follows the state; the distance is a nonlinear parameter."""
        unit = scene.robot.torque_unit(member.place)
        return {"amplitude": Parameter(float(value[0]), deviation(covariance), unit)}


def dahl_state(q: Array, distance: float, start: float = 0.0) -> Array:
    """Return the state of ``dz/dq = (1 - z sign(dq))/distance``, exact between turning points.

    Parameters
    ----------
    q : ndarray, shape (N,)
        Positions.
    start : float
        State at the first sample.

    Returns
    -------
    ndarray, shape (N,)
    """
    places = turning_points(q, SMALLEST_REVERSAL_SHARE * distance)
    q_turn = q[places]
    way = np.diff(q_turn)
    end = np.sign(way)
    left = np.exp(-np.abs(way) / distance)
    state = np.empty(len(places))
    state[0] = start
    for k in range(len(way)):
        state[k + 1] = end[k] - (end[k] - state[k]) * left[k]
    piece = np.repeat(np.arange(len(way)), np.diff(places))
    if not len(piece):
        return np.full_like(q, start)
    # Noise may lead a little behind a turning point.
    gone = np.maximum((q[:-1] - q_turn[piece]) * end[piece], 0.0)
    z = np.empty_like(q)
    z[:-1] = end[piece] - (end[piece] - state[piece]) * np.exp(-gone / distance)
    z[-1] = state[-1]
    return z


def turning_points(q: Array, least: float) -> NDArray[np.intp]:
    """Return first and last sample and the turning points between them that are at least ``least`` apart in q.

    Parameters
    ----------
    q : ndarray, shape (N,)

    Returns
    -------
    ndarray of int
        Increasing.
    """
    step = np.sign(np.diff(q))
    going = np.flatnonzero(step)
    turns = going[1:][step[going[1:]] != step[going[:-1]]]
    # The last extreme is held until the position has come back from it by enough.
    kept = [0]
    extreme, direction = 0, 0.0
    for place in (*turns.tolist(), len(q) - 1):
        change = q[place] - q[extreme]
        if direction == 0.0:
            if abs(change) >= least:
                extreme, direction = place, float(np.sign(change))
        elif change * direction >= 0.0:
            extreme = place
        elif abs(change) >= least:
            kept.append(extreme)
            extreme, direction = place, -direction
    if direction and extreme not in (0, len(q) - 1):
        kept.append(extreme)
    if kept[-1] != len(q) - 1:
        kept.append(len(q) - 1)
    return np.array(kept, dtype=np.intp)
