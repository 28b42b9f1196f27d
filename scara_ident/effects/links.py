"""Rigid-body torques when a payload or a joint's position differs from what the model takes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.regressor.derivative import derivative
from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.vectors import floats
from scara_ident.model.terms import RigidBody
from scara_ident.motion.motion import Motion
from scara_ident.robot.kinematics import place_of, tool_frame
from scara_ident.robot.robot import Robot

# A joint's inertia in its most folded pose is more than this share of its mean, or the estimate of it is a poor one.
MIN_FOLDED_SHARE = 0.02
# A link's inertia stays above this share of its usual one, however folded, where the estimate is a poor one.
MIN_INERTIA = 0.1

T = TypeVar("T")

_SHARED: WeakKeyDictionary[Signals | Scene | Motion, dict[Hashable, Any]] = WeakKeyDictionary()

# Of each motion and joint the estimate that slopes were taken at, and the slopes.
_SLOPES: WeakKeyDictionary[Motion, dict[int, tuple[Array, tuple[Array, Array, Array]]]] = WeakKeyDictionary()


def shared(owner: Signals | Scene | Motion, key: Hashable, make: Callable[[], T]) -> T:
    """Return what several members of a family need of a stretch of motion, with or without an estimate, or of a scene, made once.

    What is made of a motion must not follow from its torque: it is that of all motions that differ by it alone.
    """
    held = _SHARED.setdefault(owner.kinematics if isinstance(owner, Motion) else owner, {})
    if key not in held:
        held[key] = make()
    found: T = held[key]
    return found


def forget_shared(motion: Motion) -> None:
    """Forget what members share of a motion; it is made again where it is asked for."""
    _SHARED.pop(motion.kinematics, None)
    _SLOPES.pop(motion.kinematics, None)


@dataclass(frozen=True, eq=False)
class Tool:
    """Where a payload sits.

    Attributes
    ----------
    joint : int
        Place in the robot's joints of the last one, which carries it.
    point : ndarray, shape (3,)
        In the frame of that joint, m.
    kernel : RegressorKernel
        Torque per standard parameter of what that joint carries.
    """

    joint: int
    point: Array
    kernel: RegressorKernel

    def columns(self, robot: Robot, motion: Motion) -> Array:
        """Return the torque per standard parameter of a body fixed to the last link, shape (n, 10, N)."""
        back = np.argsort(robot.order)
        columns = self.kernel(motion.q[back], motion.v[back], motion.a[back])[robot.order]
        return np.asarray(columns * robot.row_scale[:, None, None])


@lru_cache(maxsize=8)
def tool_of(robot: Robot) -> Tool:
    """Return the tool of a robot: of the frames that its last joint carries, the one farthest from that joint."""
    frame = tool_frame(robot)
    body = 10 * (int(frame.parentJoint) - 1)
    point = np.array(frame.placement.translation)
    return Tool(place_of(robot, int(frame.parentJoint)), point, build_kernel(robot.model, range(body, body + 10)))


def point_mass(point: Array) -> Array:
    """Return the standard parameters of 1 kg at a point, Pinocchio's order, the inertia about the frame's origin."""
    x, y, z = point
    return np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])


def rigid_torque(scene: Scene, motion: Motion, q: Array, v: Array, a: Array) -> Array:
    """Return what `Signals.rigid` gives, at other positions, velocities and accelerations, shape (n, N)."""
    term = scene.model.rigid_body
    moved = Motion(motion.name, motion.trajectory, motion.time, q, v, a, None, motion.rate)
    value = scene.value[scene.model.place(term)]
    return _traced_torque(term, value, moved) if q.dtype == object else term.torque(moved, value)


def _traced_torque(term: RigidBody, value: Array, motion: Motion) -> Array:
    """Return the same where the motion is recorded expressions, of one sample."""
    robot, back = term.robot, np.argsort(term.robot.order)
    q, v, a = (part[back, 0].tolist() for part in (motion.q, motion.v, motion.a))
    standard = term.standard(value)
    bodies, armature = standard[: 10 * robot.n].reshape(-1, 10), standard[10 * robot.n :]
    found: list[Any] = trace_torque(
        joint_geometry(robot.model), floats(robot.model.gravity.linear), bodies[back], q, v, a
    )
    rows = [
        found[int(place)] + rotor * motion.a[j, 0]
        for j, (place, rotor) in enumerate(zip(robot.order, armature, strict=True))
    ]
    return np.array([[scale * row] for scale, row in zip(robot.row_scale.tolist(), rows, strict=True)], dtype=object)


def rigid_slopes(signals: Signals, joint: int) -> tuple[Array, Array, Array]:
    """Return the derivatives of all rigid-body torques by one joint's position, velocity and acceleration, each (n, N).

    Kept for the last estimate of the base model's parameters: they take more time than what is made of them.
    """
    scene, motion = signals.scene, signals.motion
    if motion.q.dtype == object:
        return _traced_slopes(signals, joint)
    held = _SLOPES.setdefault(motion.kinematics, {})
    if joint not in held or held[joint][0] is not scene.value:
        term = scene.model.rigid_body
        by_q, by_v, by_a = term.slopes(motion, scene.value[scene.model.place(term)], joint)
        held[joint] = scene.value, (by_q, by_v, by_a)
    return held[joint][1]


def on_links_at(signals: Signals, q: Array, v: Array, a: Array) -> Array:
    """Return what `Signals.on_links` gives, at other positions, velocities and accelerations, shape (n, N)."""
    motion = signals.motion
    moved = Motion(motion.name, motion.trajectory, motion.time, q, v, a, None, motion.rate)
    return Signals(signals.scene, moved).on_links


def link_slopes(signals: Signals, joint: int) -> tuple[Array, Array, Array]:
    """Return `rigid_slopes` with those of what effects in the model do to the links, each (n, N)."""
    rigid = rigid_slopes(signals, joint)
    if not signals.scene.link_torques:
        return rigid

    def made() -> tuple[Array, Array, Array]:
        found = list(rigid)
        for item in signals.scene.link_torques:
            for k, slope in enumerate(item.effect.link_slopes(signals, item.member, np.array(item.value), joint)):
                found[k] = found[k] + slope
        by_q, by_v, by_a = found
        return by_q, by_v, by_a

    return shared(signals, ("on links", joint), made)


def _traced_slopes(signals: Signals, joint: int) -> tuple[Array, Array, Array]:
    """Return the same where signals are recorded expressions, exactly."""
    motion, found = signals.motion, []
    rigid: list[Any] = signals.rigid[:, 0].tolist()
    for part in (motion.q, motion.v, motion.a):
        variable: Any = part.item(joint)
        slope: Any = signals.rigid.copy()
        slope[:, 0] = derivative(rigid, variable)
        found.append(slope)
    return found[0], found[1], found[2]


def rigid_rows(signals: Signals) -> list[Array]:
    """Return the rigid bodies' columns that act on each joint at the recorded motion, which are at hand, shape (k, N) each."""
    model = signals.scene.model
    place = model.place(model.rigid_body)
    bounds = (np.searchsorted(own, (place.start, place.stop)) for own in model.active)
    return [rows[a:b] for rows, (a, b) in zip(signals.columns, bounds, strict=True)]


def behind(motion: Motion, joint: int, lag: tuple[Array, Array, Array]) -> Motion:
    """Return a motion with the link of one joint, which lags its motor, in place of the motor."""
    q, v, a = motion.q.copy(), motion.v.copy(), motion.a.copy()
    for part, own in zip((q, v, a), lag, strict=True):
        part[joint] -= own
    return Motion(motion.name, motion.trajectory, motion.time, q, v, a, None, motion.rate)


def lagging(signals: Signals, joint: int, lag: tuple[Array, Array, Array]) -> Array:
    """Return the change of all torques (n, N), recorded side, when the link of one joint lags its motor, to first order in the lag.

    The motor, whose rotor is not part of what lags, moves as recorded.

    Parameters
    ----------
    lag : tuple of ndarray (N,)
        Motor's position less the link's, at the joint, with its first two derivatives; may be of the first samples alone.
    """
    return np.array([lagging_at(signals, place, joint, lag) for place in range(signals.scene.robot.n)])


def lagging_slopes(
    signals: Signals,
    place: int,
    joints: Sequence[int],
    slopes: Sequence[tuple[Array, Array, Array]],
    lags: Sequence[tuple[Array, Array, Array]],
) -> Array:
    """Return the derivatives of the torque that lags change at the joint of a place, by m parameters that they depend on, shape (m, N).

    Parameters
    ----------
    joints : sequence of int
        Those whose links lag.
    slopes : sequence of tuple of ndarray, shape (n, N)
        Of each `link_slopes`, at the motion that the lags are linear about.
    lags : sequence of tuple of ndarray, shape (m, N)
        Of each lagging joint the derivatives of the lag by the parameters, and of its first two derivatives.
    """
    scene = signals.scene
    each = [[slope[place] for slope in own] for own in slopes]
    for joint, own in zip(joints, each, strict=True):
        if joint == place:
            own[2] = own[2] - scene.robot.row_scale[joint] * scene.armature(joint)
    result = np.zeros(lags[0][0].shape)
    change, part = np.empty(result.shape[1:]), np.empty(result.shape[1:])
    # Row after row: a part of all rows at once lies scattered in memory, and takes half as long again.
    for k, row in enumerate(result):
        for (by_q, by_v, by_a), (x, first, second) in zip(each, lags, strict=True):
            np.multiply(by_q, x[k], out=change)
            change += np.multiply(by_v, first[k], out=part)
            change += np.multiply(by_a, second[k], out=part)
            row -= change
    return result


def lagging_at(signals: Signals, place: int, joint: int, lag: tuple[Array, Array, Array]) -> Array:
    """Return what `lagging` changes at the joint of a place, of one lag (N,) or of several (..., N)."""
    by_q, by_v, by_a = (slope[place, : lag[0].shape[-1]] for slope in link_slopes(signals, joint))
    rotor = signals.scene.robot.row_scale[joint] * signals.scene.armature(joint) if place == joint else 0.0
    return np.asarray(rotor * lag[2] - (by_q * lag[0] + by_v * lag[1] + by_a * lag[2]))


def link_inertia(signals: Signals, joint: int) -> Array:
    """Return the inertia that a joint moves without its rotor, the other joints held, at the joint, shape (N,)."""
    scene = signals.scene
    by_a = link_slopes(signals, joint)[2][joint]
    return np.asarray(by_a / scene.robot.row_scale[joint] - scene.armature(joint))


def held_link_inertia(signals: Signals, joint: int) -> Array:
    """Return `link_inertia`, held above a share of the usual one, shape (N,)."""
    return np.maximum(link_inertia(signals, joint), MIN_INERTIA * usual_link_inertia(signals.scene, joint))


def usual_link_inertia(scene: Scene, joint: int) -> float:
    """Return the mean of `link_inertia` over poses within a turn or a metre, at the joint; negative where misjudged."""
    return float(np.mean(moved_inertia(scene, joint, joint))) - scene.armature(joint)


def usual_link_inertia_slopes(scene: Scene, joint: int) -> Array:
    """Return the derivatives of `usual_link_inertia` by the parameters of the rigid bodies, shape (p,)."""
    moved = np.mean(_inertia_columns(scene.model.rigid_body, joint, joint), axis=0)
    return np.asarray(moved - scene.armature_slopes(joint))


def largest_armature(scene: Scene, joint: int) -> float:
    """Return the armature that would leave the link no inertia in its most folded pose; infinite where misjudged."""
    moved = moved_inertia(scene, joint, joint)
    least = float(np.min(moved))
    return least if least > MIN_FOLDED_SHARE * float(np.mean(moved)) > 0.0 else np.inf


def moved_inertia(scene: Scene, place: int, joint: int) -> Array:
    """Return the torque at one joint per acceleration of another or its own with the rotor, over 40 poses, shape (40,)."""
    term = scene.model.rigid_body
    return np.asarray(_inertia_columns(term, place, joint) @ scene.value[scene.model.place(term)])


@lru_cache(maxsize=64)
def _inertia_columns(term: RigidBody, place: int, joint: int) -> Array:
    """Return that inertia per parameter of the rigid bodies, shape (40, p)."""
    robot = term.robot
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q = reach * np.random.default_rng(0).uniform(-1.0, 1.0, (robot.n, 40))
    rest, pushed = np.zeros_like(q), np.zeros_like(q)
    pushed[joint] = 1.0
    still, moved = (Motion("poses", "poses", np.arange(40.0), q, rest, a, None, 1.0) for a in (rest, pushed))
    return np.asarray((term.regressor(moved) - term.regressor(still))[place].T / robot.row_scale[place])


def guessed_armatures(scene: Scene) -> dict[int, float]:
    """Return the armature to begin with of every joint whose rotor nobody stated and the base model cannot tell.

    It is the nominal one, or half of what the estimate leaves room for.
    """
    return {
        joint: min(scene.nominal_armature(joint), 0.5 * largest_armature(scene, joint))
        for joint in range(scene.robot.n)
        if not scene.robot.rotor_stated[joint] and scene.known_armature(joint) is None
    }
