"""Torques that depend on the arm's position."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.parameters import Coefficient, Member, Parameter, View, deviation
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.base_parameters import constant_torques, standard_regressor
from scara_ident.model.terms import Column
from scara_ident.model.terms.friction import Offset
from scara_ident.robot.robot import Robot


class Spring(Effect):
    """A cable or hose that pulls a joint to a rest position: ``u = k (q - q0)``.

    A model with a torque offset already contains the constant ``-k q0``. The rest position is then the one of a joint
    without an offset, and no recording can determine its error: its standard deviation is infinite.
    """

    name = "spring"
    summary = "a spring, such as a cable or hose"
    coefficients: ClassVar[tuple[Coefficient, ...]] = (
        Coefficient(
            "stiffness", "{torque}/{position}", "stiffness of a spring on {joint}",
            "it would push away from its rest position",
        ),
        Coefficient("preload", "{torque}", "torque of the spring on {joint} at position zero"),
    )  # fmt: skip
    at_rest = True
    on_links = True
    of_position = True
    of_state = True
    watched = True
    view = View("position")
    experiment = "hold still, or move very slowly, at positions over the whole range: a spring's torque grows with the angle, a tilt's follows the sine of the angle"

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the deflection, and the constant where the model has no offset."""
        both = super().columns(scene, member)
        return both if offset_of(scene, member.place) is None else both[:1]

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return position and, without an offset in the model, one; the drive works in its own direction."""
        j = member.place
        q = signals.scene.robot.drive_sign[j] * signals.motion.q[j]
        return [q, np.ones_like(q)] if offset_of(signals.scene, j) is None else [q]

    def torque_on_links(self, signals: Signals, member: Member, value: Array) -> Array:
        """Return it with the joint's offset, which is the spring's: see `parameters`."""
        found, scene = super().torque_on_links(signals, member, value), signals.scene
        offset = offset_of(scene, member.place)
        if offset is not None:
            found[member.place] = found[member.place] + scene.value[offset]
        return found

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return stiffness and rest position."""
        j = member.place
        robot = scene.robot
        stiffness, sign = float(value[0]), float(robot.drive_sign[j])
        offset = offset_of(scene, j)
        preload = sign * float(value[1] if offset is None else scene.value[offset])
        rest = -preload / stiffness if stiffness else np.nan
        spread = np.inf
        if offset is None and stiffness:
            gradient = np.array([-rest, -sign]) / stiffness
            spread = float(np.sqrt(gradient @ covariance @ gradient))
        unit = robot.position_unit(j)
        return {
            "stiffness": Parameter(stiffness, deviation(covariance), f"{robot.torque_unit(j)}/{unit}"),
            "rest_position": Parameter(rest, spread, unit),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say that an offset would look the same as another rest position."""
        caveat = "; the rest position is right only if the joint has no torque offset"
        return self.summary + ("" if offset_of(scene, member.place) is None else caveat)

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say what else it may be on a joint that goes up and down."""
        weight = abs(weight_along(scene.robot).get(member.place, 0.0)) * abs(scene.robot.row_scale[member.place])
        if not weight:
            return ""
        return f"; or a rope, chain or cable of {float(value[0]) / weight:.3g} kg/m whose hanging weight grows as the joint goes up"


class RopeWeight(Spring):
    """A rope, chain or cable whose hanging length grows as a vertical joint goes down.

    Its force is that of a mass ``-mass_per_length h`` on the joint, h the height. A spring would need a negative
    stiffness for this, so no spring explains it. If a rope runs over a pulley to a counterweight, it leaves one side
    and adds to the other: its mass per length then counts twice. The part that hangs at position zero belongs to the
    weight that the joint carries. If the hanging weight grows as the joint goes up, as with a chain that lies on the
    floor, it cannot be distinguished from a spring.
    """

    name = "rope_weight"
    summary = "a rope, chain or cable whose hanging weight grows as the joint goes down"
    coefficients = (
        Coefficient(
            "mass_per_length", "kg/m", "mass added to {joint} per length of downward motion",
            "its weight would fall as the joint goes down, as with a spring",
        ),
    )  # fmt: skip
    watched = False
    view = View("position")
    experiment = (
        "hold still, or move very slowly, at heights over the whole range; weigh a length of the rope, chain or cable"
    )
    not_simulated = "the springs of the virtual arm pull to their rest position"

    def joints(self, scene: Scene) -> list[int]:
        """Return the joints that go up and down wherever the arm is."""
        lifts = weight_along(scene.robot)
        return [j for j in super().joints(scene) if j in lifts]

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the mass per length; a constant weight is the bodies'."""
        return super(Spring, self).columns(scene, member)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return minus the position times the weight of 1 kg."""
        j, robot = member.place, signals.scene.robot
        return [-abs(weight_along(robot)[j]) * robot.row_scale[j] * signals.motion.q[j]]

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the mass per length."""
        return {"mass_per_length": Parameter(float(value[0]), deviation(covariance), "kg/m")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say that over a pulley it counts twice."""
        return self.summary + " (twice its mass per length where it runs over a pulley to a counterweight)"

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Return nothing: no spring does this."""
        return ""


def offset_of(scene: Scene, joint: int) -> int | None:
    """Return the place of the joint's torque offset among the model's columns, None without one."""
    offset = next((term for term in scene.model.terms if isinstance(term, Offset)), None)
    if offset is None or joint not in offset.places:
        return None
    return int(scene.model.place(offset).start) + offset.places.index(joint)


@lru_cache(maxsize=8)
def weight_along(robot: Robot) -> Mapping[int, float]:
    """Return what holds 1 kg on each joint that goes up and down wherever the arm is, N in its positive direction, by its place."""
    rest = np.zeros((robot.n, 1))
    columns = standard_regressor(robot, rest, rest, rest)[:, :, 0]
    return {j: float(columns[j, 10 * j]) for j in constant_torques(robot)}
