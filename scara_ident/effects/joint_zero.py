"""A joint whose recorded position has another zero than the robot's description."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.following import POSITION_STEP
from scara_ident.effects.links import rigid_rows, rigid_slopes, rigid_torque
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Tie, View
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.spanned import Span, random_motion, rows_by_sample
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import joint_rows
from scara_ident.motion.motion import Motion

# Shift of a joint's zero, rad or m, for a central difference: its error, the step squared, lies far below `ABSORBED_SHARE`.
ZERO_STEP = 1e-4
# A change that is a smaller share of the torque is what rounding leaves of none.
ROUNDING = 1e-12
# An offset below this, rad or m, is that of the derivative: of the difference only rounding would be left.
MIN_OFFSET = 1e-6
# An offset of half a turn is the largest there is, and a fit may come to lie a little beyond it. Of a sliding joint it is far more
# than any, m.
LARGEST_OFFSET = 1.1 * np.pi


class JointZero(Effect):
    """A joint whose true position is ``offset`` larger than recorded: ``u = Y(q + offset e_j, v, a) theta``.

    Its home position was set differently, or its maker counts from another pose than the URDF. The torque is computed
    at the joint's true position, whatever the size of the offset; if two joints have an offset, their joint
    contribution of second order is left out. If base parameters absorb the torque of any offset, as for the last joint,
    whose link then only seems to be different, the effect cannot be found, and the joint is listed among those that the
    model absorbs.
    """

    name = "joint_zero"
    summary = "a zero position of {joint} that differs from the URDF's"
    coefficients = (Coefficient("offset", "{position}", "position of {joint} in the URDF minus the recorded position"),)
    nonlinear = (NonlinearParameter("_offset", "{position}", -LARGEST_OFFSET, LARGEST_OFFSET, False),)
    all_joints = True
    at_rest = True
    follows_estimate = True
    on_links = True
    fitted_first = True
    of_state = True
    view = View("position")
    experiment = (
        "bring the joint to the URDF's zero, by its marks or by a level on its link, and read its position; or move "
        "slowly through its whole range with the outer joints in several positions"
    )

    def joints(self, scene: Scene) -> list[int]:
        """Return the joints whose zero the base model's parameters do not take up."""
        identifiable = _identifiable(scene.model)
        return [j for j in super().joints(scene) if j in identifiable]

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return no offset, where the column is the derivative; the fit goes on from there."""
        return ((0.0,),)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the change of torque per offset."""
        return [_Moved(signals, member.place, *member.nonlinear).change]

    def tie(self, scene: Scene, member: Member) -> Tie:
        """Return the offset that the torque is that of."""
        bodies = len(scene.model.rigid_body.columns)
        return Tie(member.nonlinear[0], np.append(np.zeros(bodies + 1), 1.0))

    def slopes(self, signals: Signals, member: Member) -> Iterable[tuple[NDArray[np.intp], Array]]:
        """Give the derivatives with the offset that multiplies the column as it is."""
        return _Moved(signals, member.place, *member.nonlinear).slopes()

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where the fit went on to the end of what there is."""
        if abs(member.nonlinear[0]) >= LARGEST_OFFSET:
            return "no offset within half a turn fits"
        return super().inadmissible(scene, member, value, std)

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say which line of the robot's description mends it."""
        robot, offset = scene.robot, float(value[0])
        joint, unit = robot.joints[member.place], robot.position_unit(member.place)
        degrees = f" ({np.degrees(offset):+.4g} deg)" if unit == "rad" else ""
        return (
            f": {offset:+.4g} {unit}{degrees} is to be added, in robot.yaml under recording, position: "
            f"offset: {{{joint}: ...}}, in the unit there"
        )


@dataclass(frozen=True, eq=False)
class _Moved:
    """An arm of which one joint stands elsewhere by an offset.

    Attributes
    ----------
    signals : Signals
        At the recorded positions.
    offset : float
        rad or m.
    """

    signals: Signals
    joint: int
    offset: float

    @cached_property
    def change(self) -> Array:
        """Torque of all joints less that at the recorded positions, per offset, recorded side, shape (n, N)."""
        if abs(self.offset) < MIN_OFFSET:
            return rigid_slopes(self.signals, self.joint)[0]
        return np.asarray((self._torque(self.offset) - self.signals.rigid) / self.offset)

    def slopes(self) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Give of each joint the derivatives of offset times `change`, that offset held, see `Effect.slopes`."""
        term, here = self.signals.scene.model.rigid_body, rigid_rows(self.signals)
        there = joint_rows(term, moved_motion(self.signals.motion, self.joint, self.offset))
        ends = (self._torque(self.offset + side * POSITION_STEP) for side in (1.0, -1.0))
        by_offset = np.subtract(*ends) / (2.0 * POSITION_STEP) - self.change
        last = len(term.columns) + 1
        for j, acting in enumerate(term.pattern):
            yield np.append(np.flatnonzero(acting), last), np.vstack([there[j] - here[j], by_offset[j]])

    def _torque(self, offset: float) -> Array:
        moved = moved_motion(self.signals.motion, self.joint, offset)
        return rigid_torque(self.signals.scene, moved, moved.q, moved.v, moved.a)


def moved_motion(motion: Motion, joint: int, offset: float) -> Motion:
    """Return a motion with one joint elsewhere by an offset."""
    q = motion.q.copy()
    q[joint] += offset
    return Motion(motion.name, motion.trajectory, motion.time, q, motion.v, motion.a, None, motion.rate)


def zero_columns(model: TorqueModel, motion: Motion, rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
    """Give what a wrong zero of each joint does to the torque of rigid bodies, of arbitrary base parameters, (n, 1, N)."""
    term = model.rigid_body
    value = rng.uniform(0.5, 1.5, len(term.columns))
    rigid = np.einsum("jpn,p->jn", term.regressor(motion), value)
    for k in range(model.robot.n):
        torque = []
        for step in (ZERO_STEP, -ZERO_STEP):
            moved = moved_motion(motion, k, step)
            torque.append(np.einsum("jpn,p->jn", term.regressor(moved), value))
        change = torque[0] - torque[1]
        # What rounding leaves of no change at all is not a column.
        if np.max(np.abs(change)) < ROUNDING * np.max(np.abs(rigid)):
            change = np.zeros_like(change)
        yield k, change[:, None]


@lru_cache(maxsize=8)
def _identifiable(model: TorqueModel) -> frozenset[int]:
    """Return the joints whose zero the parameters of a model do not take up, whatever the arm does."""
    rng = np.random.default_rng(0)
    motion = random_motion(model.robot, rng, 40 + len(model.columns))
    span = Span.of(rows_by_sample(model.regressor(motion)))
    return frozenset(
        k for k, columns in zero_columns(model, motion, rng) if span.carriers(rows_by_sample(columns)) is None
    )
