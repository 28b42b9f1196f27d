"""Identification beside a controller: updates a second, and how far apart false alarms are.

Run ``python benchmarks/online.py [--hours H] [--seed S] [--only speed|alarms]``. False alarms are counted in noise
alone, asked for once in an hour.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np

from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.online import OnlineIdentifier, OnlineSettings
from scara_ident.robot.robot import load_robot

SECONDS, NOISE_SHARE = 40.0, 0.05
BLOCKS = (64, 512, 2048, 8192)


def motion_of(model: TorqueModel, rate: float, seconds: float) -> Motion:
    """Return sums of three sines on each joint."""
    random = np.random.default_rng(0)
    time_ = np.arange(round(seconds * rate)) / rate
    speed, phase = random.uniform(1.0, 4.0, (3, model.robot.n, 1)), random.uniform(0.0, 6.0, (3, model.robot.n, 1))
    each = 0.5 * np.sin(speed * time_ + phase), 0.5 * speed * np.cos(speed * time_ + phase)
    signals = [*each, -0.5 * speed**2 * np.sin(speed * time_ + phase)]
    q, v, a = (np.sum(part, axis=0) for part in signals)
    return Motion("online", "online", time_, q, v, a, None, rate)


def torque_of(model: TorqueModel, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return torque without noise, and the noise that goes with it."""
    value = np.random.default_rng(1).standard_normal(len(model.columns))
    clean = np.array([value[own] @ rows for own, rows in zip(model.active, model.joint_columns(motion), strict=True)])
    return clean, NOISE_SHARE * np.std(clean, axis=1)


def speed(name: str | None) -> None:
    model = build_model(load_robot(name))
    motion = motion_of(model, 1000.0, SECONDS)
    clean, sigma = torque_of(model, motion)
    effort = clean + sigma[:, None] * np.random.default_rng(2).standard_normal(clean.shape)
    single = OnlineIdentifier(model, sigma)
    samples = [signal.T.copy() for signal in (motion.q, motion.v, motion.a, effort)]
    start = time.process_time(), time.perf_counter()
    for sample in zip(*samples, strict=True):
        single.update(*sample)
    cpu, wall = time.process_time() - start[0], time.perf_counter() - start[1]
    count, n = motion.samples, model.robot.n
    print(
        f"{model.robot.name}: {n} joints, {len(model.columns)} parameters: {count / cpu:.0f} single updates/s "
        f"({count / wall:.0f} on the clock); load {os.getloadavg()[0]:.1f}"
    )
    for block in BLOCKS:
        blocks = OnlineIdentifier(model, sigma, OnlineSettings(block=block, window=10.0))
        start = time.process_time(), 0.0
        blocks.update_block(motion.q, motion.v, motion.a, effort)
        spent = time.process_time() - start[0]
        print(f"  blocks of {block}: {n * count / spent / 1e6:.2f} million rows/s")


def false_alarms(hours: float, seed: int) -> None:
    """Count alarms in noise alone; the chart counts blocks, here of one second each, whatever the rate."""
    model, rate = build_model(load_robot(), "basic"), 50.0
    settings = OnlineSettings(rate=rate, block=50, false_alarms=1.0, window=2.0, memory=3600.0)
    motion = motion_of(model, rate, 300.0)
    clean, sigma = torque_of(model, motion)
    online, random, alarms = OnlineIdentifier(model, sigma, settings), np.random.default_rng(seed), 0
    rounds = max(1, round(hours * 3600.0 / 300.0))
    for _ in range(rounds):
        effort = clean + sigma[:, None] * random.standard_normal(clean.shape)
        alarms += len(online.update_block(motion.q, motion.v, motion.a, effort))
    print(f"false alarms: {alarms} in {rounds / 12.0:.0f} h, {settings.false_alarms:g} an hour asked for")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--only", choices=("speed", "alarms"))
    options = parser.parse_args()
    for name in (None, "panda") if options.only != "alarms" else ():
        speed(name)
    if options.only != "speed":
        false_alarms(options.hours, options.seed)


if __name__ == "__main__":
    main()
