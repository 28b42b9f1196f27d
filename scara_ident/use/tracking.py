"""How well an arm follows a motion by its controller alone, and with torque fed forward from a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import LostArm, ScaraIdentError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.motion.motion import Motion
from scara_ident.simulation.arm import VirtualArm, ideal
from scara_ident.simulation.effects import Effect
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.reference import ReferenceMotion
from scara_ident.simulation.simulate import SimulationResult, simulate
from scara_ident.threads import side_by_side
from scara_ident.use.identified_arm import light_joint

# Rounds in which the torque that effects ask for is found; each leaves a few per cent of what the last one missed. The
# controller in them is so many times as fast as the arm's: with no noise about, the faster the nearer.
ROUNDS = 4
FASTER = (3.0, 1.0)
# Samples per second of the controller, and integration steps per sample: by twice as many no error differs by a hundredth.
RATE, SUBSTEPS = 1000.0, 2
# Steps for an arm that is lost in these: much friction on a joint of next to no inertia is faster than they are.
MORE_SUBSTEPS = 16


@dataclass(frozen=True, eq=False)
class Tracked:
    """A motion followed with one feed-forward.

    Attributes
    ----------
    name : str
    time : ndarray, shape (N,)
        s.
    error : ndarray, shape (n, N)
        Wanted less true position of the drives, rad or m.
    """

    name: str
    time: Array
    error: Array

    @property
    def rms(self) -> Array:
        """Rms error of every joint, shape (n,)."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=1)))


def at_ticks(motion: ReferenceMotion) -> ReferenceMotion:
    """Return a motion at the ticks of the controller."""
    count = int(np.floor(motion.duration * RATE * (1.0 + 1e-12) + 1e-9)) + 1
    moved = motion.at(motion.time[0] + np.arange(count) / RATE)
    return replace(moved, time=np.arange(count) / RATE)


def urdf_torque(arm: VirtualArm, motion: ReferenceMotion) -> Array:
    """Return the torque by the URDF alone, with the rotors that it states and without friction, shape (n, N).

    On the effort side, at the samples of the motion.
    """
    robot = arm.robot
    nominal = robot.standard_parameters()[: 10 * robot.n].reshape(-1, 10)
    bare = replace(
        arm, rotor_inertia=robot.rotor_inertia, friction=np.zeros((robot.n, 4)), torque_offset=np.zeros(robot.n)
    )
    torque = inverse_dynamics(bare, nominal, motion.position, motion.velocity, motion.acceleration)
    return np.asarray(torque / arm.scale[:, None])


def foreseen_torque(model: IdentifiedModel, motion: ReferenceMotion) -> Array:
    """Return the torque that a model with the effects found foresees, shape (n, N), at the samples of the motion."""
    signals = motion.position, motion.velocity, motion.acceleration
    known = replace(model, value=np.nan_to_num(model.value))
    return known.torque(Motion(motion.name, motion.name, motion.time, *signals, None, RATE))


def needed_torque(
    arm: VirtualArm, effects: Sequence[Effect], motion: ReferenceMotion, first: Array | None = None
) -> Array:
    """Return the torque that lets an arm follow a motion, shape (n, N), on the effort side.

    Without effects it is inverse dynamics. With them an ideal arm, without encoder steps, follows the motion in simulation
    with the torque so far fed forward, and what the controller added is added to it (iterative learning control,
    Arimoto, Kawamura and Miyazaki 1984); so elastic joints and states of friction are met as well.

    Parameters
    ----------
    arm : VirtualArm
    effects : sequence of Effect
    motion : ReferenceMotion
        At the ticks of the controller, see `at_ticks`.
    first : ndarray, shape (n, N), optional
        Fed forward at first where there are effects; inverse dynamics without them by default.

    Raises
    ------
    ScaraIdentError
        If no controller holds the arm.
    """
    torque = inverse_dynamics(arm, arm.bodies, motion.position, motion.velocity, motion.acceleration)
    feed = np.asarray(torque / arm.scale[:, None])
    if not effects:
        return feed
    feed = feed if first is None else first
    scale = np.maximum(np.ptp(motion.position, axis=1), np.finfo(float).eps)[:, None]
    for faster in FASTER:
        stiff = replace(ideal(arm), controller=arm.controller.faster(faster))
        tried, learned, least = feed, feed, np.inf
        try:
            for _ in range(ROUNDS + 1):
                run = _followed(stiff, motion, effects, tried)
                error = float(np.sqrt(np.mean(((run.motion.position - run.true.position) / scale) ** 2)))
                if error >= least:
                    # What is faster than the controller, as a ripple, it makes worse.
                    break
                learned, least, tried = tried, error, run.true.effort
        except ScaraIdentError as error:
            # An elastic joint bears no fast controller.
            lost = error
            continue
        return learned
    raise lost


def tracked(
    arm: VirtualArm,
    effects: Sequence[Effect],
    motion: ReferenceMotion,
    feeds: Mapping[str, Array | None],
    seed: int = 0,
) -> tuple[Tracked, ...]:
    """Let an arm follow a motion with each of several torques fed forward.

    Parameters
    ----------
    arm : VirtualArm
        As it is, unknown to what is fed forward.
    effects : sequence of Effect
        That it has.
    motion : ReferenceMotion
        At the ticks of the controller.
    feeds : mapping of str to ndarray of shape (n, N), or None
        Fed forward, on the effort side; None for the PID alone.
    seed : int, optional
        Of the encoders' zeros.

    Raises
    ------
    ScaraIdentError
        If the controller loses the arm.
    """

    def follow(name: str, feed: Array | None) -> Tracked:
        run = _followed(arm, motion, effects, feed, seed)
        return Tracked(name, run.motion.time, run.motion.position - run.true.position)

    return tuple(side_by_side(follow, feeds.keys(), feeds.values()))


def _followed(
    arm: VirtualArm, motion: ReferenceMotion, effects: Sequence[Effect], feed: Array | None, seed: int = 0
) -> SimulationResult:
    """Return a run of an arm, or say why none with its parameters can be held."""
    for steps in (SUBSTEPS, MORE_SUBSTEPS):
        try:
            return simulate(arm, motion, effects=effects, feed=feed, rate=RATE, seed=seed, min_substeps=steps)
        except LostArm:
            continue
    raise LostArm(
        f"{motion.name}: no controller stabilises {arm.robot.name} with these parameters: {light_joint(arm)}; record a "
        f"motion that excites its inertia (`scara-ident excite`), or find with `scara-ident diagnose` what the model "
        f"lacks"
    )
