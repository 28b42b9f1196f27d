"""Run the virtual arm along a motion and record it as a real one would be."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError, UsageError
from scara_ident.manners import Reported
from scara_ident.recording.recording import Recording
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects import Effect
from scara_ident.simulation.effects.structure import Payload
from scara_ident.simulation.inverse_dynamics import torque_at_start
from scara_ident.simulation.plant import PlantDraft
from scara_ident.simulation.position_sensor import recorded_position
from scara_ident.simulation.reference import MAX_SAMPLES, ReferenceMotion
from scara_ident.simulation.runs import RunState, TorqueNoise
from scara_ident.simulation.torque_sensor import recorded_effort
from scara_ident.simulation.true_motion import TrueMotion, needed_substeps, true_motion

# Integration steps per controller period: on the SCARA03 the energy then drifts by 4e-15 in 10 s, and friction that
# depends on speed, spring and ripple effects are resolved with a margin.
SUBSTEPS = 4
WHITE = TorqueNoise()


@dataclass(frozen=True, eq=False, repr=False)
class SimulationResult(Reported, reported_by="simulation"):
    """A recording, with the arm, effects and motion that produced it.

    Attributes
    ----------
    arm : VirtualArm
    effects : tuple of Effect
        With all their sizes.
    motion : ReferenceMotion
        The reference motion, at the times of the recording.
    recording : Recording
    true : TrueMotion
    seed, repetition : int
    rate : float
        Of the recording, Hz.
    substeps : int
        Integration steps per period of the controller.
    stops : int
        Number of stops of a joint between the steps.
    """

    arm: VirtualArm
    effects: tuple[Effect, ...]
    motion: ReferenceMotion
    recording: Recording
    true: TrueMotion
    seed: int
    repetition: int
    rate: float
    substeps: int
    stops: int


def simulate(
    arm: VirtualArm,
    motion: ReferenceMotion,
    *,
    effects: Sequence[Effect] = (),
    seed: int = 0,
    repetition: int = 1,
    rate: float = 1000.0,
    ticks: int = 1,
    averaged: bool = False,
    substeps: int | None = None,
    min_substeps: int = SUBSTEPS,
    record_velocity: bool = False,
    link_encoders: Sequence[str] = (),
    noise: TorqueNoise = WHITE,
    run: RunState | None = None,
    feed: Array | None = None,
) -> SimulationResult:
    """Let the virtual arm follow a motion in closed loop.

    The arm starts on the reference, with its speed, and with the integral part at the torque that this needs. At every
    sample the encoder is read, the PID computes a torque, and the drive holds it until the next sample. The recorded effort is
    the mean over one period of the controller centred on the sample, so that it does not lag position, plus noise.

    Parameters
    ----------
    arm : VirtualArm
    motion : ReferenceMotion
        It is interpolated if its samples are not those of the controller.
    effects : sequence of Effect
        Sizes that are not given are taken from the arm. Effects of another recording are left out.
    seed : int
        Seed of noise and encoder zero; the same seed and repetition give the same recording.
    repetition : int
        Number of the run; every run has its own noise.
    rate : float
        Samples per second of the recording.
    ticks : int
        Periods of the controller per sample: it runs at ``ticks`` times the rate, and one of them is recorded.
    averaged : bool
        Whether the recorded effort is instead the mean over a whole sample, which avoids aliasing.
    substeps : int, optional
        Integration steps per period of the controller; default: `min_substeps`, or more if an elastic joint needs them.
    min_substeps : int, optional
        Smallest number of integration steps; two are enough for tracking errors, in half the time.
    record_velocity : bool
        Whether the recording has the velocity that the controller saw.
    link_encoders : sequence of str
        Joints with a second encoder behind the gear, with the same resolution at the joint and its own zero.
    noise : TorqueNoise
        Distribution of the noise; its standard deviation is the arm's.
    run : RunState, optional
        Differences of this run from the arm; default: none.
    feed : ndarray, shape (n, ticks), optional
        Torque on the effort side, added to the PID's at every tick of the controller; its integral then starts at 0.

    Returns
    -------
    SimulationResult

    Raises
    ------
    UsageError
        If the motion is for other joints, an effect does not fit, ``ticks`` is under 1, or ``feed`` is too short or
        too long.
    LostArm
        If the controller loses control of the arm.

    Examples
    --------
    >>> from scara_ident import load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0).recording
    Recording(OJK_1: 2 joints, 5001 samples at 250 Hz)
    """
    if ticks < 1:
        raise UsageError(f"ticks is {ticks}; expected 1 or more periods of the controller per sample")
    name = f"{motion.name}_{repetition}"
    moved, own = arm, resolved_effects(arm, [each for each in effects if each.recording in (None, name)])
    if run is not None:
        # Sizes that were left open are those of the arm, not of the run.
        moved = run.of(arm)
    draft = _draft(moved, own)
    if run is not None:
        run.measure(arm, draft)
    control = ticks * rate
    wanted = _at_rate(arm, motion, control)
    back = np.argsort(arm.robot.order)
    # The name takes part, so that no two trajectories share their noise.
    random = np.random.default_rng([seed, repetition, zlib.crc32(motion.name.encode())])
    draft.sensors["shift"] = random.uniform(size=arm.robot.n)[back]
    zero = draft.zero[arm.robot.order, None]
    # The controller knows the recorded position only.
    reached = replace(wanted, position=wanted.position + zero)
    start = np.zeros(arm.robot.n) if feed is not None else torque_at_start(moved, reached, loaded_bodies(moved, own))
    added = np.zeros((arm.robot.n, len(wanted.time))) if feed is None else np.asarray(feed, dtype=float)
    if added.shape != wanted.position.shape:
        raise UsageError(f"feed has shape {added.shape}; expected {wanted.position.shape}, a column per tick")
    position, velocity = reached.position[back], reached.velocity[back]
    steps = max(min_substeps, needed_substeps(moved, draft, control)) if substeps is None else substeps
    measured, seen, true, stops = true_motion(
        moved, draft, control, steps, np.stack([position.T, velocity.T]),
        (arm.scale[:, None] * added)[back].T, start[back],
        position[:, 0], velocity[:, 0], f"{motion.name} on {arm.robot.name}",
    )  # fmt: skip
    measured = recorded_position(draft, measured, 1.0 / control)
    effort = recorded_effort(arm, draft, true.effort, true.position, 1.0 / control, ticks if averaged else 1)[
        :, ::ticks
    ]
    effort = effort + arm.torque_noise[:, None] * noise.draw(random, effort.shape, rate)
    if ticks > 1:
        wanted, true = wanted.every(ticks), true.every(ticks)
    recording = Recording(
        name=name,
        trajectory=motion.name,
        repetition=repetition,
        joints=arm.robot.joints,
        time=wanted.time,
        position=np.ascontiguousarray(measured[:, ::ticks] - zero),
        effort=effort,
        velocity=np.ascontiguousarray(seen[:, ::ticks]) if record_velocity else None,
        link_position=_link_position(arm, true, link_encoders, [seed, repetition, zlib.crc32(name.encode())]),
    )
    return SimulationResult(arm, own, wanted, recording, true, seed, repetition, rate, steps, stops)


def _link_position(arm: VirtualArm, true: TrueMotion, joints: Sequence[str], seed: list[int]) -> Array | None:
    """Return what second encoders read, shape (n, N), NaN for joints without one; None where there is none."""
    if not joints:
        return None
    zero = np.random.default_rng(seed).uniform(size=arm.robot.n)
    read = np.full(true.link_position.shape, np.nan)
    for j in map(arm.robot.joint_index, joints):
        grid = arm.encoder_resolution[j]
        link = true.link_position[j]
        read[j] = grid * np.floor(link / grid + zero[j]) if grid > 0.0 else link
    return read


def free_motion(
    arm: VirtualArm,
    position: Array,
    velocity: Array,
    duration: float,
    *,
    torque: Array | None = None,
    effects: Sequence[Effect] = (),
    rate: float = 1000.0,
    substeps: int | None = None,
) -> tuple[Array, TrueMotion]:
    """Let the arm move without a controller.

    Parameters
    ----------
    arm : VirtualArm
    position, velocity : ndarray, shape (n,)
        At the start, of drives and links.
    duration : float
        s.
    torque : ndarray, shape (n,) or (n, N), optional
        Of the drives, N m on the effort side; without it none.
    effects, rate, substeps
        See `simulate`.

    Returns
    -------
    time : ndarray, shape (N,)
    motion : TrueMotion

    Raises
    ------
    LostArm
        If the arm leaves all bounds.
    """
    draft = _draft(arm, resolved_effects(arm, effects))
    n, samples = arm.robot.n, round(duration * rate) + 1
    given = np.zeros((n, 1)) if torque is None else np.asarray(torque, dtype=float).reshape(n, -1)
    back = np.argsort(arm.robot.order)
    feed = np.broadcast_to(arm.scale[:, None] * given, (n, samples))[back].T
    steps = max(SUBSTEPS, needed_substeps(arm, draft, rate)) if substeps is None else substeps
    _, _, true, _ = true_motion(
        arm, draft, rate, steps, np.zeros((2, 1, n)), feed, np.zeros(n),
        np.asarray(position, dtype=float)[back], np.asarray(velocity, dtype=float)[back],
        f"{arm.robot.name} without a controller", controlled=False,
    )  # fmt: skip
    return np.arange(samples) / rate, true


def resolved_effects(arm: VirtualArm, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return effects with all their sizes, those that were left open from the arm."""
    return tuple(effect.resolve(arm) for effect in effects)


def loaded_bodies(arm: VirtualArm, effects: Sequence[Effect]) -> Array:
    """Return the arm's bodies with what it carries at the first sample, shape (n, 10)."""
    bodies = arm.bodies.copy()
    for effect in effects:
        if isinstance(effect, Payload) and effect.time <= 0.0:
            bodies[np.argmax(arm.robot.order)] += effect.body
    return bodies


def _draft(arm: VirtualArm, effects: Sequence[Effect]) -> PlantDraft:
    draft = arm.draft()
    for effect in effects:
        effect.apply(arm, draft)
    return draft


def _at_rate(arm: VirtualArm, motion: ReferenceMotion, rate: float) -> ReferenceMotion:
    if motion.joints != arm.robot.joints:
        raise UsageError(f"{motion.name}: moves {', '.join(motion.joints)}, the arm has {', '.join(arm.robot.joints)}")
    if not rate > 0.0:
        raise UsageError(f"rate is {rate:g} Hz; expected a positive number")
    samples = int(np.floor(motion.duration * rate * (1.0 + 1e-12) + 1e-9)) + 1
    if not 2 <= samples <= MAX_SAMPLES:
        wrong = "less than a sample" if samples < 2 else f"more than {MAX_SAMPLES} samples"
        raise RecordingError(f"{motion.name}: lasts {motion.duration:g} s, {wrong} at {rate:g} Hz; give time in s")
    moved = motion.at(motion.time[0] + np.arange(samples) / rate)
    return ReferenceMotion(
        motion.name, motion.joints, np.arange(samples) / rate, moved.position, moved.velocity, moved.acceleration
    )
