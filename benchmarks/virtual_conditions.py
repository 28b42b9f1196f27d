"""Under what a random set is recorded: all the draws but those of the arm, its effects and its motions.

Half of the sets have repetitions of the same motion, three in ten of all have files that are numbered through and so do
not tell which are. Half differ from run to run: in friction, in torque scale or offset by day, in delay, each with
odds of two in three. The rotor's inertia is stated in half of the sets. Where the controller is faster than the recording
the torque is sampled in half of the sets and averaged in the other half. A third of the sets begin each recording with the
motion, a third at any time within a sample before it, a third by hand.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from virtual_motions import KINDS, MotionKind

from scara_ident.simulation import RunState, VirtualArm

RATES = (100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)
# The controller runs at the smallest multiple of the recording's rate that is no less than this, Hz.
CONTROLLER_RATE = 500.0
BITS = (12, 23)
NOISE = (0.003, 0.05)
DURATION = (5.0, 30.0)
MAX_RECORDINGS = 8
HELD_OUT_DURATION = (8.0, 15.0)
# Half widths of what is drawn evenly: friction by run, torque scale and offset (a share of the usual torque) by day, and
# the largest delay by run, s.
FRICTION, SCALE, OFFSET, DELAY = 0.06, 0.02, 0.02, 0.005
Noise = Literal["white", "coloured", "heavy"]
# How a recording begins: with the motion, less than a sample before it, or up to `BY_HAND` before it, s.
Start = Literal["with the motion", "within a sample", "by hand"]
STARTS: tuple[Start, ...] = ("with the motion", "within a sample", "by hand")
BY_HAND = 0.5


@dataclass(frozen=True)
class Variation:
    """How far runs differ; 0 where they do not, see `FRICTION`, `SCALE`, `OFFSET` and `DELAY`."""

    friction: float = 0.0
    scale: float = 0.0
    offset: float = 0.0
    delay: float = 0.0
    days: int = 1

    @property
    def any(self) -> bool:
        """Whether runs differ at all."""
        return any((self.friction, self.scale, self.offset, self.delay))


@dataclass(frozen=True)
class Run:
    """One recording: the number of its motion, its repetition, the day, and whether it is held out."""

    motion: int
    kind: MotionKind
    duration: float
    repetition: int
    day: int
    held_out: bool


@dataclass(frozen=True)
class Conditions:
    """Conditions of a set.

    Attributes
    ----------
    rate : float
        Samples per second of the recordings.
    bits : int
        Encoder steps per turn of the joint, as a power of 2; 0 for none.
    noise : float
        Standard deviation of the recorded torque, as a share of the joint's rms torque in the training motions.
    noise_kind : str
    correlation_time : float
        Of coloured noise, s.
    stated : bool
        Whether the robot's description states reductions and rotor inertias.
    averaged : bool
        Whether the recorded torque is the mean over a sample, not that of one period of the controller.
    start : str
        When recordings begin, see `Start`.
    numbered : bool
        Whether files are numbered through instead of named by motion and repetition.
    variation : Variation
    runs : tuple of Run
    scatter : float
        Standard deviation of recorded positions beside the encoder's steps, in steps; not of what the controller reads.
    """

    rate: float
    bits: int
    noise: float
    noise_kind: Noise
    correlation_time: float
    stated: bool
    averaged: bool
    start: Start
    numbered: bool
    variation: Variation
    runs: tuple[Run, ...]
    scatter: float = 0.0

    @property
    def ticks(self) -> int:
        """Periods of the controller per sample."""
        return int(np.ceil(CONTROLLER_RATE / self.rate - 1e-9))

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, with the counts that tables are made by."""
        training = [run for run in self.runs if not run.held_out]
        return asdict(self) | {
            "recordings": len(training),
            "motions": len({run.motion for run in training}),
            "length": sum(run.duration for run in training),
        }


@dataclass(frozen=True)
class Asked:
    """Conditions that are asked for instead of drawn; None is drawn. Events and scatter are there only where they are asked for."""

    rate: float | None = None
    bits: int | None = None
    noise: float | None = None
    noise_kind: Noise | None = None
    stated: bool | None = None
    averaged: bool | None = None
    start: Start | None = None
    recordings: int | None = None
    motions: int | None = None
    duration: tuple[float, float] | None = None
    varied: bool | None = None
    events: bool = False
    scatter: float = 0.0


def draw_conditions(rng: np.random.Generator, asked: Asked) -> Conditions:
    """Draw the conditions of one set; what is asked for does not change the other draws."""
    rate = float(rng.choice(RATES))
    bits = int(rng.integers(BITS[0], BITS[1] + 1))
    noise = float(np.exp(rng.uniform(*np.log(NOISE))))
    noise_kind: Noise = ("white", "coloured", "heavy")[rng.integers(3)]
    correlation_time = float(np.exp(rng.uniform(np.log(0.002), np.log(0.03))))
    stated, numbered = bool(rng.random() < 0.5), bool(rng.random() < 0.3)
    averaged, start = bool(rng.random() < 0.5), STARTS[rng.integers(len(STARTS))]
    drawn = Variation(
        friction=FRICTION * (rng.random() < 2 / 3),
        **{("scale", "offset")[rng.integers(2)]: 0.02 * (rng.random() < 2 / 3)},
        delay=DELAY * (rng.random() < 2 / 3),
        days=int(rng.integers(1, 4)),
    )
    varied = bool(rng.random() < 0.5)
    variation = drawn if (varied if asked.varied is None else asked.varied) else Variation()
    return Conditions(
        rate=rate if asked.rate is None else asked.rate,
        bits=bits if asked.bits is None else asked.bits,
        noise=noise if asked.noise is None else asked.noise,
        noise_kind=noise_kind if asked.noise_kind is None else asked.noise_kind,
        correlation_time=correlation_time,
        stated=stated if asked.stated is None else asked.stated,
        averaged=averaged if asked.averaged is None else asked.averaged,
        start=start if asked.start is None else asked.start,
        numbered=numbered,
        variation=variation,
        runs=_draw_runs(rng, asked, variation.days),
        scatter=asked.scatter,
    )


def _draw_runs(rng: np.random.Generator, asked: Asked, days: int) -> tuple[Run, ...]:
    count = int(rng.integers(1, MAX_RECORDINGS + 1)) if asked.recordings is None else asked.recordings
    motions = count
    if count > 1 and rng.random() < 0.5:
        motions = int(rng.integers(max(1, count // 3), count))
    motions = min(count, motions if asked.motions is None else asked.motions)
    held_out = int(rng.integers(1, 3))
    # Every motion once, and the other runs repeat some of them.
    number = np.concatenate([np.arange(motions), rng.integers(motions, size=count - motions)])
    kinds = [KINDS[k] for k in rng.integers(len(KINDS), size=motions + held_out)]
    lengths = rng.uniform(*(asked.duration or DURATION), size=motions)
    lengths = np.concatenate([lengths, rng.uniform(*HELD_OUT_DURATION, size=held_out)]).round(2)
    runs, seen = [], [0] * motions
    for k, motion in enumerate(sorted(number)):
        seen[motion] += 1
        day = k * days // count
        runs.append(Run(int(motion), kinds[motion], float(lengths[motion]), seen[motion], day, held_out=False))
    for motion in range(motions, motions + held_out):
        day = int(rng.integers(days))
        runs.append(Run(motion, kinds[motion], float(lengths[motion]), 1, day, held_out=True))
    return tuple(runs)


def draw_lead(rng: np.random.Generator, conditions: Conditions) -> float:
    """Draw for how long the arm rests in a recording before it moves, s."""
    share = rng.uniform()
    return float(
        {"with the motion": 0.0, "within a sample": share / conditions.rate}.get(conditions.start, share * BY_HAND)
    )


def draw_states(
    rng: np.random.Generator, arm: VirtualArm, conditions: Conditions, usual: NDArray[np.float64]
) -> list[RunState]:
    """Draw in what each run differs; ``usual`` is the rms torque of each joint on the effort side, shape (n,)."""
    n, variation = arm.robot.n, conditions.variation
    by_day = rng.uniform(-1.0, 1.0, (variation.days, n))
    states = []
    for run in conditions.runs:
        by_run = rng.uniform(-1.0, 1.0, n)
        states.append(
            RunState(
                friction=1.0 + variation.friction * by_run,
                torque_scale=1.0 + variation.scale * by_day[run.day],
                torque_offset=variation.offset * usual * by_day[run.day],
                delay=float(variation.delay * rng.uniform()),
            )
        )
    return states
