"""Identification beside a controller: updates a second, how soon a payload is seen, and how far apart false alarms are.

Run ``python benchmarks/online.py [--hours H] [--seed S] [--only speed|alarms|payload|band]``. False alarms are counted in noise
alone, asked for once in an hour, over many runs side by side (`benchmarks/online_lanes.py`). With a band positions are rounded as
encoders do and nothing else is given but torques (`benchmarks/online_band.py`).
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np
from online_band import band
from online_lanes import Lanes, blocks_of

from scara_ident.effects.links import point_mass, tool_of
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.online import OnlineIdentifier, OnlineSettings
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm

SECONDS, NOISE_SHARE = 40.0, 0.05
BLOCKS = (64, 512, 2048, 8192)
# Runs side by side; rounds of the motion in which the first is compared with the package, and how near it is to be.
MAX_LANES, COMPARED, SAME = 100, 12, 1e-9
TOLD_ROUNDS = 6
# Share of the arm's mass, and how often it is attached.
PAYLOAD, PAYLOAD_RUNS = 0.05, 50


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
    blocks = blocks_of(model, sigma, motion, settings.block)
    lanes, random = Lanes(model, settings, max(1, min(MAX_LANES, round(hours)))), np.random.default_rng(seed)
    online, alarms, apart = OnlineIdentifier(model, sigma, settings), [], 0.0
    rounds = max(1, round(hours / lanes.lanes * 12.0))
    for turn in range(rounds):
        for k, block in enumerate(blocks):
            some = slice(k * settings.block, (k + 1) * settings.block)
            noise = random.standard_normal((lanes.lanes, *clean[:, some].shape))
            lanes.absorb(block, clean[:, some] / sigma[:, None] + noise)
            # The first lane is done by the package too.
            if turn < COMPARED:
                effort = clean[:, some] + sigma[:, None] * noise[0]
                signals = (part[:, some] for part in (motion.q, motion.v, motion.a))
                alarms += [turn * len(blocks) + k + 1] * len(online.update_block(*signals, effort))
        if turn < COMPARED:
            apart = max(apart, float(np.max(np.abs(online.value - lanes.value[0]) / np.abs(online.value))))
            same = alarms == [at for at, lane in lanes.alarms if lane == 0]
            if apart > SAME or not same:
                raise SystemExit(f"lanes are not what the package does: {apart:.1e}, {alarms}, {lanes.alarms}")
        if turn + 1 == rounds or (turn + 1) % TOLD_ROUNDS == 0:
            simulated, stated = (turn + 1) * lanes.lanes / 12.0, settings.false_alarms
            print(
                f"false alarms: {len(lanes.alarms)} in {simulated:.0f} h of {lanes.lanes} runs, {stated:g} an hour asked for: "
                f"{len(lanes.alarms) / simulated / stated:.2f}; one run and the package apart by {apart:.1e}",
                flush=True,
            )


def payload(runs: int, seed: int) -> None:
    """Attach 5 % of the arm's mass at the tool after 7 s of motion, with 1 false alarm in 100 h."""
    model, settings = build_model(load_robot(), "basic"), OnlineSettings(false_alarms=0.01)
    robot, term, tool = model.robot, model.rigid_body, tool_of(model.robot)
    standard = np.zeros(term.base.grouping.shape[1])
    mass = PAYLOAD * robot.standard_parameters()[: 10 * robot.n : 10].sum()
    standard[10 * tool.joint : 10 * tool.joint + 10] = mass * point_mass(tool.point)
    random, motion = np.random.default_rng(seed), motion_of(model, 1000.0, 10.0)
    value, more = np.zeros((2, len(model.columns)))
    value[model.place(term)] = term.base.grouping[term.kept] @ robot.standard_parameters()
    value[model.place(model.terms[1])] = virtual_arm(robot).friction[:, :2].ravel()
    more[model.place(term)] = term.base.grouping[term.kept] @ standard
    columns, start, seconds, named = model.joint_columns(motion), 7000, [], 0
    clean, with_load = (
        np.array([of[own] @ rows for own, rows in zip(model.active, columns, strict=True)])
        for of in (value, value + more)
    )
    sigma = NOISE_SHARE * np.std(clean, axis=1)
    clean[:, start:] = with_load[:, start:]
    for _ in range(runs):
        online = OnlineIdentifier(model, sigma, settings)
        effort = clean + sigma[:, None] * random.standard_normal(clean.shape)
        alarms = online.update_block(motion.q, motion.v, motion.a, effort)
        seconds.append((alarms[0].sample - start) / 1000.0 if alarms else np.inf)
        named += bool(alarms) and alarms[0].effect == "payload_change"
    print(
        f"payload of {mass:.2f} kg, {100 * PAYLOAD:g} % of the arm: seen within 1 s in {sum(0.0 < x <= 1.0 for x in seconds)} of "
        f"{runs} runs, median {np.median(seconds):.2f} s, longest {max(seconds):.2f} s; named as one in {named}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--only", choices=("speed", "alarms", "payload", "band"))
    options = parser.parse_args()
    for name in (None, "panda") if options.only in (None, "speed") else ():
        speed(name)
    if options.only in (None, "payload"):
        payload(PAYLOAD_RUNS, options.seed)
    if options.only in (None, "alarms"):
        false_alarms(options.hours, options.seed)
    if options.only == "band":
        band(options.hours, options.seed)


if __name__ == "__main__":
    main()
