"""What random arms meet in some of their recordings: pushes, and a payload; drawn beside all else, with its truth.

A third of the recordings have a push of 5 to 30 N for 0.3 to 2 s, two in three of them at the tool and the others at a link
before it, towards where the arm can give way. In half of the sets some recordings, of at least two, have a payload of 2 to
15 % of the arm's mass, anyhow mounted near the tool; in a quarter of those it comes or goes during the recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.robot.kinematics import tool_frame
from scara_ident.simulation import Effect, ReferenceMotion, SimulationResult, VirtualArm
from scara_ident.simulation.effects import Payload, Push
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.spatial import configuration

Array = NDArray[np.float64]
PUSHED, AT_TOOL, LOADED, CHANGES = 1 / 3, 2 / 3, 0.5, 0.25
FORCE, LASTS, CALM = (5.0, 30.0), (0.3, 2.0), 0.5
# Share of the arm's mass; distance of the centre of mass from the tool, and radius of gyration, m.
MASS, AWAY, GYRATION = (0.02, 0.15), 0.12, (0.02, 0.08)
# Samples of an event at which its torque is taken.
SAMPLES = 50


def draw_events(
    rng: np.random.Generator, arm: VirtualArm, motions: Sequence[ReferenceMotion]
) -> list[tuple[Effect, ...]]:
    """Draw what each recording meets; ``motions`` are those of the recordings."""
    events: list[tuple[Effect, ...]] = [_push(rng, arm, motion) for motion in motions]
    count = len(motions)
    loaded, changes = rng.random() < LOADED, rng.random() < CHANGES
    body, chosen = _payload(rng, arm), rng.permutation(count)[: int(rng.integers(1, max(count, 2)))]
    share = rng.uniform(0.25, 0.75, count)
    comes = rng.random(count) < 0.5
    if loaded and count > 1:
        for k in chosen:
            time = float(share[k] * motions[k].duration) if changes else 0.0
            held = replace(body, time=time if comes[k] else 0.0, until=time if changes and not comes[k] else None)
            events[k] = (*events[k], held)
    return events


def _push(rng: np.random.Generator, arm: VirtualArm, motion: ReferenceMotion) -> tuple[Effect, ...]:
    there, at_tool = rng.random() < PUSHED, rng.random() < AT_TOOL
    force, lasts = (float(np.exp(rng.uniform(*np.log(span)))) for span in (FORCE, LASTS))
    begin = float(rng.uniform(CALM, max(motion.duration - lasts - CALM, CALM + 0.1)))
    towards = rng.normal(size=arm.robot.n)
    inner = arm.robot.links[int(rng.integers(arm.robot.n // 2, arm.robot.n))]
    if not there:
        return ()
    effect = Push(force=force, time=begin, duration=lasts, link=None if at_tool else inner).resolve(arm)
    pose = motion.position[:, np.searchsorted(motion.time, motion.time[0] + begin)]
    way = point_jacobian(arm, effect, pose) @ towards
    return (replace(effect, direction=tuple((way / np.linalg.norm(way)).tolist())),)


def _payload(rng: np.random.Generator, arm: VirtualArm) -> Payload:
    mass = float(rng.uniform(*MASS) * arm.bodies[:, 0].sum())
    com = arm.tool + rng.uniform(-AWAY, AWAY, 3)
    sides = rng.uniform(*GYRATION, 3) ** 2
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    # Second moments about the centre of mass, turned: the inertia is that of some body whatever they are.
    second = mass * turn @ np.diag(sides) @ turn.T
    inertia = np.trace(second) * np.eye(3) - second
    return Payload(mass=mass, com=tuple(com.tolist()), inertia=tuple(inertia[np.triu_indices(3)].tolist()))


def point_jacobian(arm: VirtualArm, push: Push, position: Array) -> Array:
    """Return the Jacobian of the pushed point's velocity in the base frame, shape (3, n), robot's order."""
    robot = arm.robot
    joint, point = robot.n, np.array(push.point)
    if push.link is not None:
        frame = tool_frame(robot, push.link)
        joint, point = frame.parentJoint, frame.placement.act(point)
    model = pin.Model(robot.model)
    place = model.addFrame(pin.Frame("pushed", joint, pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME))
    full = configuration(model, position[np.argsort(robot.order)])
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.asarray(pin.computeFrameJacobian(model, model.createData(), full, place, world)[:3, robot.order])


def event_truth(arm: VirtualArm, effect: Effect, result: SimulationResult, recording: str) -> dict[str, Any]:
    """Return an event: where, from when to when, and the rms of the torque that it takes from each joint meanwhile."""
    time, true = result.recording.time, result.true
    begin, end = effect.time, time[-1]
    if isinstance(effect, Push):
        end = min(end, begin + effect.duration)
    elif effect.until is not None:
        end = min(end, effect.until)
    inside = np.flatnonzero((time >= begin) & (time <= end))
    chosen = inside[np.linspace(0, len(inside) - 1, min(SAMPLES, len(inside))).astype(int)]
    q, v, a = (x[:, chosen] for x in (true.position, true.velocity, true.acceleration))
    if isinstance(effect, Push):
        force = effect.force * np.array(effect.direction) / np.linalg.norm(effect.direction)
        torque = np.array([point_jacobian(arm, effect, pose).T @ force for pose in q.T]).T
    else:
        bodies = arm.bodies.copy()
        bodies[np.argmax(arm.robot.order)] += effect.body
        torque = inverse_dynamics(arm, bodies, q, v, a) - inverse_dynamics(arm, arm.bodies, q, v, a)
    size = np.sqrt(np.mean(torque**2, axis=1)) * np.abs(arm.robot.row_scale)
    return {
        "recording": recording,
        "kind": effect.name,
        "from": float(begin),
        "to": float(end),
        "rms": dict(zip(arm.robot.joints, size.tolist(), strict=True)),
        "parameters": effect.as_dict()["parameters"],
    }
