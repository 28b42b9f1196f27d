"""Recordings and tables for the tests of the diagnosis: short runs of the virtual SCARA03, and rows made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, Rows
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.selection.search import Search, SearchTask, scene_of, search
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Coefficient, Effect, Member, NonlinearParameter
from scara_ident.effects.position import Spring
from scara_ident.estimation import Estimate, wls
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.residuals import Residuals
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import motion_of, stretches
from scara_ident.motion.prepared import prepare
from scara_ident.paper import table5_parameters
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import ReferenceMotion, parse_effect, sampled, simulate, virtual_arm
from tests.arms import noisy, recorded_torque, recording

Array = NDArray[np.float64]

BANDS = (11.0, 11.0)
NOISE = (0.02, 0.008)
RATE = 250.0


class Bump(Effect):
    """A torque at one place of the first joint, which is tried at a few only."""

    name = "bump"
    summary = "bump"
    coefficients = (Coefficient("height", "N m", "height of a bump"),)
    nonlinear = (NonlinearParameter("place", "rad", -1.0, 4.0, False),)

    def members(self, scene):
        return tuple(Member(0, (place,)) for place in (0.5, 1.0, 1.5, 2.0))

    def signal_columns(self, signals, member):
        return [np.exp(-(((signals.motion.q[0] - member.nonlinear[0]) / 0.3) ** 2))]


class Bent(Spring):
    """A spring that is softer on one side."""

    name = "bent"

    def signal_columns(self, signals, member):
        turn = signals.motion.q[0] - 1.57
        return [turn + 0.01 * turn**2]


@lru_cache(maxsize=16)
def multisine(name: str, seed: int, duration: float, size: float = 1.9) -> ReferenceMotion:
    """Five harmonics per joint within ``size`` rad about the middle and 2.5 rad/s."""
    robot = load_robot()
    rng = np.random.default_rng(seed)
    omega = 2.0 * np.pi * np.arange(1, 6) / duration
    amplitude = rng.normal(0.0, 1.0, (2, 5)) / np.arange(1, 6)
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, 5, 1))

    def wave(t: Array, order: int) -> Array:
        turn = omega[:, None] * t + phase + 0.5 * np.pi * order
        return np.einsum("jk,jkt->jt", amplitude * omega**order, np.cos(turn))

    t = np.linspace(0.0, duration, 400)
    reach = np.minimum(size / np.abs(wave(t, 0)).max(axis=1), 2.5 / np.abs(wave(t, 1)).max(axis=1))
    amplitude *= reach[:, None]
    centre = np.array([[1.57], [0.0]])
    return sampled(name, robot, lambda t: (centre + wave(t, 0), wave(t, 1), wave(t, 2)), duration)


@lru_cache(maxsize=16)
def virtual_runs(*effects: str, seed: int = 1, seconds: tuple[float, float] = (7.0, 8.0)) -> tuple[Recording, ...]:
    """Two trajectories, twice each, of an arm with undeclared effects."""
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    motions = (multisine("F1", 1, seconds[0]), multisine("F2", 2, seconds[1]))
    return tuple(
        simulate(arm, motion, effects=[parse_effect(text) for text in effects], seed=seed, repetition=k).recording
        for motion in motions
        for k in (1, 2)
    )


@lru_cache(maxsize=1)
def held_out_run(effect: str) -> Recording:
    """A run of a third trajectory."""
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    return simulate(arm, multisine("F3", 3, 6.0), effects=[parse_effect(effect)], seed=7).recording


@lru_cache(maxsize=4)
def exact_runs(trajectories: int = 2, repetitions: int = 2, size: float = 1.9) -> tuple[Recording, ...]:
    """Runs of formulas: torque of the complete model and white noise, and nothing else."""
    robot = load_robot()
    truth = table5_parameters("OJD")
    friction = [(*truth[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]
    made = []
    for k in range(trajectories):
        motion = multisine("ABC"[k], 3 + k, 12.0, size).at(np.arange(round(12.0 * RATE)) / RATE)
        torque = recorded_torque(robot, motion.position, motion.velocity, motion.acceleration, friction)
        for r in range(1, repetitions + 1):
            clean = recording(robot, f"{motion.name}_{r}", motion.time, motion.position, torque)
            made.append(noisy(clean, np.random.default_rng([k, r]), NOISE))
    return tuple(made)


@lru_cache(maxsize=4)
def periodic_run(periods: int = 3, seconds: float = 6.0) -> Recording:
    """One run of a motion that comes again, as `exact_runs` made."""
    robot = load_robot()
    truth = table5_parameters("OJD")
    friction = [(*truth[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]
    motion = multisine("P", 3, seconds).at(np.arange(round(seconds * RATE)) / RATE)
    signals = [np.tile(item, periods) for item in (motion.position, motion.velocity, motion.acceleration)]
    torque = recorded_torque(robot, *signals, friction)
    time = np.arange(signals[0].shape[1]) / RATE
    return noisy(recording(robot, "P_1", time, signals[0], torque), np.random.default_rng(7), NOISE)


def with_torque(recordings: Sequence[Recording], joint: int, added) -> list[Recording]:
    """Add ``added(motion)`` to the effort of a joint."""
    made = []
    for item in recordings:
        (part,) = stretches(item)
        effort = item.effort.copy()
        effort[joint] += added(motion_of(part, (None, None)))
        made.append(replace(item, effort=effort))
    return made


def runs_that_repeat(size: float, added=lambda run: 0.0) -> list[Recording]:
    """Three runs each of two motions, whose first joint has further torque that is white, and the same in each repetition."""
    made = []
    for run in exact_runs(2, 3):
        rng = np.random.default_rng([1, ord(run.name[0])])
        effort = run.effort.copy()
        effort[0] += size * rng.standard_normal(effort.shape[1]) + added(run)
        made.append(replace(run, effort=effort))
    return made


def runs_with_a_spring() -> list[Recording]:
    """Runs of small and of large motion, with offsets of their own that a spring of another shape can stand for."""
    runs = [*exact_runs(size=0.6)[:2], *exact_runs(size=1.2)[2:]]
    return [
        with_torque([item], 0, lambda motion, offset=offset: 3.0 * (motion.q[0] - 1.57) + offset)[0]
        for item, offset in zip(runs, (-0.1, -0.1, 0.1, 0.1), strict=True)
    ]


@cache
def complete() -> TorqueModel:
    return build_model(load_robot(), "complete")


def observed(recordings: Sequence[Recording], bands=BANDS) -> Observations:
    """The complete model's rows on recordings."""
    return observe(complete(), prepare(recordings, bands))


def fitted(recordings: Sequence[Recording], bands=BANDS) -> Estimate:
    """The weighted estimate of the complete model."""
    return wls(observed(recordings, bands))


def residuals_of(value: Array, recordings: Sequence[Recording], bands=BANDS) -> Residuals:
    """What parameters of the complete model leave of recordings."""
    return observed(recordings, bands).residuals(value)


def step_beside(
    recordings: Sequence[Recording], chosen: Sequence[Candidate] = (), weights: Array | None = None, bands=BANDS
) -> SelectionStep:
    """The complete model with effects, fitted to recordings, as candidates are tried beside it."""
    seen = observed(recordings, bands)
    start = wls(seen)
    scene = scene_of(seen.model, start.value, seen)
    weights = start.weights if weights is None else weights
    return SelectionStep(scene, CandidateColumns(seen), tuple(chosen), weights, 10, CRITERIA)


def searched(recordings: Sequence[Recording], *catalogue: Effect, bands=BANDS) -> Search:
    """What the search finds beside the complete model."""
    return search(SearchTask(complete(), catalogue), CandidateColumns(observed(recordings, bands)))


def model_of(columns: Array, torque: Array, recordings: int = 4, block: int = 40) -> FittedModel:
    """A model of one joint's columns (N, m), the rows cut into recordings of equal length, each its own fold."""
    count = len(torque)
    starts = np.append(np.arange(0, count, block), count)
    owner = starts[:-1] * recordings // count
    rows = JointRows(np.arange(columns.shape[1]), np.vstack([columns.T, torque]), starts, np.diff(starts).astype(float))
    return FittedModel((rows,), columns.shape[1], owner, owner, np.ones(1))


def uneven_blocks(seed: int) -> tuple[FittedModel, list[Rows]]:
    """Rows of three joints in blocks of any length, none among them, and candidates on one joint, two and all.

    The model's last column is the sum of two others. Of the last three candidates one is the model's but for a little,
    one wholly, and one in one of its two columns.
    """
    rng = np.random.default_rng(seed)
    acting = ([0, 1, 3, 5], [1, 2, 3, 5], [2, 4, 5])
    owner = np.sort(np.concatenate([np.arange(4), rng.integers(0, 4, 32)]))
    value, carried, size = rng.standard_normal(6), rng.standard_normal(6), 10.0 ** rng.uniform(-3, 3, 7)
    candidates: list[Rows] = [{} for _ in range(7)]
    joints = []
    for j, own in enumerate(acting):
        counts = rng.integers(0, 30, len(owner))
        counts[rng.permutation(len(owner))[:9]] = 0
        starts = np.concatenate([[0], np.cumsum(counts)])
        columns = np.zeros((6, starts[-1]))
        columns[own] = lfilter([1.0], [1.0, -0.9], rng.standard_normal((len(own), starts[-1])))
        columns[5] = columns[1] + columns[2]
        torque = value @ columns + lfilter([1.0], [1.0, -0.5], rng.standard_normal(starts[-1]))
        for k, (places, width) in enumerate([([0], 1), ([1, 2], 2), *[(range(3), width) for width in (1, 3, 1, 1, 2)]]):
            if j in places:
                other = rng.standard_normal((width, starts[-1]))
                known = carried @ columns
                rows = {
                    4: known + 1e-2 * np.std(known) * other,
                    5: known[None],
                    6: np.array([known, other[0]][:width]),
                }.get(k, other)
                candidates[k][j] = size[k] * rows
        joints.append(JointRows(np.array(own), np.vstack([columns[own], torque]), starts, counts.astype(float)))
    return FittedModel(tuple(joints), 6, owner, owner, rng.uniform(0.3, 3.0, 3)), candidates


def dense_rows(model: FittedModel, candidate: Rows) -> tuple[Array, NDArray[np.intp]]:
    """Weighted rows of all joints, shape (N, m + k + 1): model, candidate, torque; and the block of each."""
    width = len(next(iter(candidate.values())))
    dense, block = [], []
    for j, (rows, weight) in enumerate(zip(model.joints, model.weights, strict=True)):
        wide = np.zeros((rows.table.shape[1], model.parameters + width + 1))
        wide[:, rows.columns] = rows.table[:-1].T
        wide[:, model.parameters : -1] = candidate[j].T if j in candidate else 0.0
        wide[:, -1] = rows.table[-1]
        dense.append(weight * wide)
        block.append(np.repeat(np.arange(len(model.owner)), np.diff(rows.starts)))
    return np.vstack(dense), np.concatenate(block)
