"""Signals of a stretch of motion that effects are made of, each computed once."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.motion.low_pass import HIGHEST_CUT, low_pass
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

if TYPE_CHECKING:
    from scara_ident.effects.effect import Effect
    from scara_ident.effects.parameters import Member

# Share of its range that a joint must travel at the least for its travel to say anything of it.
SMALLEST_TRAVEL = 1e-3
# The derivative of a torque keeps this many times the band, so that the band itself is left alone.
DERIVATIVE_BAND = 3.0


@dataclass(frozen=True)
class ModelledEffect:
    """An effect in the model with its coefficients, shape (k,), as estimated at present."""

    effect: Effect
    member: Member
    value: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """The robot, its base model and the present estimate, and how far the recordings reach.

    Attributes
    ----------
    model : TorqueModel
        The base model.
    value : ndarray, shape (p,)
        Present estimate of its parameters.
    duration : float
        Longest recording, s.
    rate : float
        Lowest sample rate, Hz.
    band : float
        Highest band in use, Hz.
    travel : ndarray, shape (n,)
        Range of each joint's position over all recordings.
    speed : ndarray, shape (n,)
        Largest speed of each joint over all recordings.
    start : Mapping[str, float]
        Time of the first sample of every recording, s.
    armatures : Mapping[int, float]
        Armature N^2 Jm of joints (by place) where the base model cannot determine it: as an effect does, or guessed within
        what the estimate leaves room for; nominal for the others.
    columns : Mapping[Motion, tuple of ndarray]
        The base model's columns on motions where they are at hand, see `TorqueModel.joint_columns`.
    link_torques : tuple of ModelledEffect
        Of the effects in the model beside the base model, which gears transmit too.
    together : tuple of (Effect, Member)
        Effects in the model whose members act together, see `Effect.together`, in the order of their joints.
    beside : tuple of ModelledEffect
        All effects in the model, where it is asked whether an arm can have another one beside them.
    """

    model: TorqueModel
    value: Array
    duration: float
    rate: float
    band: float
    travel: Array
    speed: Array
    start: dict[str, float]
    armatures: Mapping[int, float] = field(default_factory=dict)
    columns: Mapping[Motion, tuple[Array, ...]] = field(default_factory=dict, repr=False)
    link_torques: tuple[ModelledEffect, ...] = ()
    together: tuple[tuple[Effect, Member], ...] = ()
    beside: tuple[ModelledEffect, ...] = ()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.model.robot

    @cached_property
    def radian(self) -> Array:
        """What goes with a radian of a joint that turns, shape (n,): 1, and of one that slides its travel over pi, m.

        Lengths that are tried, and limits of them, are multiples of it: they then depend on no unit, and a stage of some
        millimetres has as many of them as a gantry of some metres. A joint that stands still has the range that its limits
        leave.
        """
        length = np.where(self.moving, self.travel, self._stroke)
        return np.where(self.robot.prismatic, length / np.pi, 1.0)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Which joints travel, by more than what an encoder may waver by, shape (n,)."""
        return np.asarray(self.travel > SMALLEST_TRAVEL * self._stroke)

    @property
    def _stroke(self) -> Array:
        stroke = self.robot.upper - self.robot.lower
        return np.where(np.isfinite(stroke), stroke, 1.0)

    def armature(self, joint: int) -> float:
        """Armature N^2 Jm of a joint: what the data tell of it, else its nominal value."""
        known = self.known_armature(joint)
        return self.armatures.get(joint, self.nominal_armature(joint)) if known is None else known

    def nominal_armature(self, joint: int) -> float:
        """Armature N^2 Jm of a joint as the robot's description has it, else guessed (`Robot.rotor_guess`)."""
        if not self.robot.rotor_stated[joint]:
            return float(self.robot.rotor_guess.armature[joint])
        return float(self.robot.reduction[joint] ** 2 * self.robot.rotor_inertia[joint])

    def known_armature(self, joint: int) -> float | None:
        """Armature N^2 Jm of a joint where the base model tells it apart from the links, else None."""
        slopes = self.armature_slopes(joint)
        return float(slopes @ self.value[self.model.place(self.model.rigid_body)]) if np.any(slopes) else None

    def armature_slopes(self, joint: int) -> Array:
        """Derivatives of `armature` by the parameters of the rigid bodies, shape (p,): 1 at the one that tells it."""
        return np.asarray(self._alone == 10 * self.robot.n + joint, dtype=float)

    @cached_property
    def _alone(self) -> NDArray[np.intp]:
        """The standard parameter that each of the rigid bodies' is where it is one alone, else -1, shape (p,)."""
        term = self.model.rigid_body
        alone = np.count_nonzero(term.base.grouping[term.kept], axis=1) == 1
        return np.where(alone, term.base.kept[term.kept], -1)


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of a stretch of motion; rows are joints in the order of the robot, N samples."""

    scene: Scene
    motion: Motion

    def at(self, scene: Scene) -> Signals:
        """Return the signals at another estimate of the same base model; what does not follow from it is shared."""
        same = scene.value is self.scene.value
        kept = ["time", "sign", "columns", "motor_turns", "_swings", *(("predicted", "rigid") if same else ())]
        if same and scene.link_torques is self.scene.link_torques:
            kept.append("on_links")
        return Signals(scene, self.motion).with_made(**{k: self.__dict__[k] for k in kept if k in self.__dict__})

    def with_made(self, **made: Any) -> Signals:
        """Return the same signals, of which some, by their names here, are made already."""
        found = copy(self)
        found.__dict__.update(made)
        return found

    @cached_property
    def time(self) -> Array:
        """Seconds since the recording began, shape (N,)."""
        return self.motion.time - self.scene.start.get(self.motion.name, float(self.motion.time[0]))

    @cached_property
    def sign(self) -> Array:
        """Direction of motion in the drive's direction, shape (n, N)."""
        return self.scene.robot.drive_sign[:, None] * np.sign(self.motion.v)

    @cached_property
    def columns(self) -> tuple[Array, ...]:
        """The base model's columns that act on each joint, see `TorqueModel.joint_columns`."""
        held = self.scene.columns.get(self.motion)
        return self.scene.model.joint_columns(self.motion) if held is None else held

    @cached_property
    def predicted(self) -> Array:
        """Recorded torque as the base model predicts it, shape (n, N)."""
        return self._predicted(np.ones(len(self.scene.value), dtype=bool))

    @cached_property
    def rigid(self) -> Array:
        """Torque of links and rotors as the base model predicts it, recorded side, shape (n, N)."""
        wanted = np.zeros(len(self.scene.value), dtype=bool)
        wanted[self.scene.model.place(self.scene.model.rigid_body)] = True
        return self._predicted(wanted)

    def _predicted(self, wanted: NDArray[np.bool_]) -> Array:
        value = np.where(wanted, self.scene.value, 0.0)
        active = self.scene.model.active
        return np.array([value[own] @ rows for own, rows in zip(active, self.columns, strict=True)])

    @cached_property
    def on_links(self) -> Array:
        """Torque on links of the effects in the model, recorded side, shape (n, N)."""
        found = np.zeros_like(self.motion.q)
        for item in self.scene.link_torques:
            found += item.effect.torque_on_links(self, item.member, np.array(item.value))
        return found

    @property
    def of_together(self) -> Array:
        """Torque of the effects in the model whose members act together, recorded side, shape (n, N)."""
        found = np.zeros_like(self.motion.q)
        for effect, member in self.scene.together:
            tie = effect.tie(self.scene, member)
            if tie is not None:
                found += tie.value * effect.regressor(self, member)[:, 0]
        return found

    @property
    def derivative_cut(self) -> float | None:
        """Low-pass of the derivatives of a torque, Hz; None where the samples have nothing above it."""
        band = DERIVATIVE_BAND * self.scene.band
        return band if band < HIGHEST_CUT * self.motion.rate else None

    def load(self, joint: int) -> Array:
        """Torque that the gear of a joint transmits, recorded side, shape (N,).

        It is the rigid torque without that of the own rotor, and what effects in the model do to the links.
        """
        if joint not in self._loads:
            own = self.scene.robot.row_scale[joint] * self.scene.armature(joint) * self.motion.a[joint]
            left: Array = self.rigid[joint] - own
            self._loads[joint] = left + self.on_links[joint] if self.scene.link_torques else left
        return self._loads[joint]

    @cached_property
    def _loads(self) -> dict[int, Array]:
        return {}

    def swing(self, joint: int) -> Array:
        """Recorded torque of a joint beyond the low-pass of its position, shape (N,); zero where no torque or no such is known.

        What a controller answers the steps of an encoder with moves the arm too, faster than the filtered motion says.
        """
        torque, cuts = self.motion.torque, self.motion.cuts
        cut = cuts[joint] if cuts else None
        if torque is None or cut is None:
            return np.zeros(self.motion.samples)
        if joint not in self._swings:
            self._swings[joint] = torque[joint] - low_pass(torque[joint], self.motion.rate, cut)
        return self._swings[joint]

    @cached_property
    def _swings(self) -> dict[int, Array]:
        return {}

    @cached_property
    def motor_turns(self) -> Array:
        """Motor angle in rad of each joint, N q, shape (n, N)."""
        return self.scene.robot.reduction[:, None] * self.motion.q
