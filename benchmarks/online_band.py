"""Identification beside a controller in a band: raw positions of an encoder and raw torques are all that it is given.

Motion and torque are exact; then positions are rounded as an encoder does, and torques have noise that is white or passed a
low-pass of first order.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from scara_ident.arrays import Array
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.online import OnlineIdentifier, OnlineSettings
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm

# Noise as a share of the torque, the load as one of the arm's mass, and seconds that are made at a time.
NOISE_SHARE, PAYLOAD, STRETCH = 0.05, 0.05, 300.0
# Runs of each case; alarms asked for in an hour, so many that some hours tell their rate.
AGREEMENT_RUNS, PAYLOAD_RUNS, STATED = 3, 5, 10.0


@dataclass(frozen=True)
class Case:
    """An arm, how it is recorded, and in which band it is identified; ``colour`` is the low-pass of the noise in Hz, 0 for none."""

    robot: str | None
    rate: float
    band: float
    bits: int
    colour: float = 0.0

    def __str__(self) -> str:
        noise = f"noise up to {self.colour:g} Hz" if self.colour else "white noise"
        return f"{self.robot or 'scara03'}, {self.rate:g} samples/s, encoders of {self.bits} bits, {noise}, band {self.band:g} Hz"


CASES = (
    Case(None, 250.0, 5.0, 13),
    Case(None, 250.0, 10.0, 17, 30.0),
    Case("ur5", 250.0, 5.0, 15),
    Case("ur5", 250.0, 10.0, 17, 30.0),
)


def states(joints: int, case: Case, seconds: float, start: float = 0.0, seed: int = 0) -> list[Array]:
    """Return sums of three sines on each joint, which are never at rest together."""
    random = np.random.default_rng(seed)
    at = start + np.arange(round(seconds * case.rate)) / case.rate
    speed, phase = random.uniform(1.0, 4.0, (3, joints, 1)), random.uniform(0.0, 6.0, (3, joints, 1))
    angle = speed * at + phase
    each = 0.5 * np.sin(angle), 0.5 * speed * np.cos(angle), -0.5 * speed**2 * np.sin(angle)
    return [np.sum(part, axis=0) for part in each]


def value_of(model: TorqueModel, mass: float = 0.0) -> Array:
    """Return the parameters of an arm with a mass at its tool."""
    robot, term, tool = model.robot, model.rigid_body, tool_of(model.robot)
    standard = robot.standard_parameters().copy()
    standard[10 * tool.joint : 10 * tool.joint + 10] += mass * point_mass(tool.point)
    value = np.zeros(len(model.columns))
    value[model.place(term)] = term.base.grouping[term.kept] @ standard
    value[model.place(model.terms[1])] = virtual_arm(robot).friction[:, :2].ravel()
    return value


def torque_of(model: TorqueModel, moved: list[Array], value: Array, rate: float) -> Array:
    q, v, a = moved
    motion = Motion("online", "online", np.arange(q.shape[1]) / rate, q, v, a, None, rate)
    return model.torque(motion, value)


class Noise:
    """Noise of unit density at low frequencies, which goes on from call to call."""

    def __init__(self, joints: int, case: Case, seed: int) -> None:
        self._random, self._keep = np.random.default_rng(seed), np.exp(-2.0 * np.pi * case.colour / case.rate)
        self._coloured, self._state = case.colour > 0.0, np.zeros((joints, 1))

    def next(self, shape: tuple[int, ...]) -> Array:
        """Return what comes next, shape (n, N)."""
        drawn = self._random.standard_normal(shape)
        if not self._coloured:
            return drawn
        drawn, self._state = lfilter([1.0 - self._keep], [1.0, -self._keep], drawn, zi=self._state, axis=1)
        return np.asarray(drawn)


def rounded(q: Array, bits: int) -> Array:
    step = 2.0 * np.pi / 2**bits
    return step * np.round(q / step)


def agreement(case: Case, runs: int, seed: int) -> None:
    """Compare parameters of two minutes with the truth and with weighted least squares of the whole recording in that band."""
    model = build_model(load_robot(case.robot), "basic")
    n, value, scores, apart, ratio = model.robot.n, value_of(model), [], [], []
    for run in range(runs):
        moved = states(n, case, 120.0, seed=seed + run)
        clean = torque_of(model, moved, value, case.rate)
        sigma = NOISE_SHARE * np.std(clean, axis=1)
        q = rounded(moved[0], case.bits)
        effort = clean + sigma[:, None] * Noise(n, case, seed + 100 + run).next(clean.shape)
        online = OnlineIdentifier(model, sigma, OnlineSettings(rate=case.rate, band=case.band, forgetting="none"))
        online.update_block(q, None, None, effort)
        recording = Recording("run_1", "run", 1, model.robot.joints, np.arange(q.shape[1]) / case.rate, q, effort)
        whole = wls(observe(model, prepare([recording], (case.band,) * n)), sigma)
        scores.append((online.value - value) / online.std)
        apart.append((online.value - whole.value) / online.std)
        ratio.append(online.std / whole.std)
    print(
        f"  parameters of 120 s, {runs} runs: from the truth {_rms(scores):.2f} standard deviations rms, from weighted least squares "
        f"of the recording {_rms(apart):.2f}; standard deviations are {np.median(ratio):.2f} of those",
        flush=True,
    )


def _rms(scores: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.square(scores))))


def alarms(case: Case, hours: float, seed: int, stated: float) -> None:
    """Count alarms in noise alone."""
    model, begun = build_model(load_robot(case.robot), "basic"), time.process_time()
    n, value = model.robot.n, value_of(model)
    settings = OnlineSettings(rate=case.rate, band=case.band, false_alarms=stated, window=2.0, memory=3600.0)
    noise, found, online = Noise(n, case, seed), 0, None
    for k in range(round(3600.0 * hours / STRETCH)):
        moved = states(n, case, STRETCH, k * STRETCH, seed)
        clean = torque_of(model, moved, value, case.rate)
        if online is None:
            sigma = NOISE_SHARE * np.std(clean, axis=1)
            online = OnlineIdentifier(model, sigma, settings)
        effort = clean + sigma[:, None] * noise.next(clean.shape)
        found += len(online.update_block(rounded(moved[0], case.bits), None, None, effort))
    print(
        f"  alarms in noise alone: {found} in {hours:g} h, {stated:g} an hour asked for: {found / hours / stated:.2f} of that; "
        f"{(time.process_time() - begun) / hours:.0f} s of work an hour",
        flush=True,
    )


def payload(case: Case, runs: int, seed: int) -> None:
    """Attach 5 % of the arm's mass at the tool after a minute."""
    model = build_model(load_robot(case.robot), "basic")
    robot, start = model.robot, round(60.0 * case.rate)
    mass = PAYLOAD * robot.standard_parameters()[: 10 * robot.n : 10].sum()
    seconds, named, early = [], 0, 0
    for run in range(runs):
        moved = states(robot.n, case, 64.0, seed=seed + run)
        clean, loaded = (torque_of(model, moved, value_of(model, more), case.rate) for more in (0.0, mass))
        sigma = NOISE_SHARE * np.std(clean, axis=1)
        clean[:, start:] = loaded[:, start:]
        effort = clean + sigma[:, None] * Noise(robot.n, case, seed + 200 + run).next(clean.shape)
        online = OnlineIdentifier(model, sigma, OnlineSettings(rate=case.rate, band=case.band))
        found = online.update_block(rounded(moved[0], case.bits), None, None, effort)
        early += sum(alarm.sample <= start for alarm in found)
        later = [alarm for alarm in found if alarm.sample > start]
        seconds.append((later[0].sample - start) / case.rate if later else np.inf)
        named += bool(later) and later[0].effect == "payload_change"
    print(
        f"  payload of {mass:.2f} kg: seen in {np.sum(np.isfinite(seconds))} of {runs} runs, median {np.median(seconds):.2f} s, "
        f"longest {max(seconds):.2f} s, named as one in {named}; alarms before: {early}",
        flush=True,
    )


def band(hours: float, seed: int) -> None:
    """Print what becomes of each case."""
    for case in CASES:
        print(case, flush=True)
        agreement(case, AGREEMENT_RUNS, seed)
        payload(case, PAYLOAD_RUNS, seed)
        alarms(case, hours, seed, STATED)
