"""Recordings of random arms like the SCARA03, each with none, one or two effects or one outside the catalogue.

Written as folders that the command line reads, so that any two commits can be compared on the same recordings: ``train``
and ``test`` of every set, with what the arm was in ``truth.json``. The same seed gives the same recordings.

    python benchmarks/virtual_sets.py SETS --count 60
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scara_ident.paper import OJD, OJK
from scara_ident.recording.recording import Recording, write_recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import EFFECTS, Effect, ReferenceMotion, VirtualArm, sampled, simulate, virtual_arm
from scara_ident.simulation.truth import truth

# Effects that are not told by one name: their size is this parameter, scaled by a random factor.
SIZE = {
    "transmission_loss": "loss_coefficient",
    "stribeck": "amplitude",
    "asymmetric_friction": "viscous_difference",
    "presliding": "presliding_distance",
    "warm_up": "share",
    "torque_ripple": "amplitude",
    "position_dependent_friction": "share",
    "spring": "stiffness",
    "base_tilt": "tilt_x",
    "payload_change": "mass",
    "time_delay": "delay",
    "torque_sensor_nonlinearity": "cubic",
    "torque_gain_mismatch": "ratio",
    "joint_elasticity": "stiffness",
    "backlash": "width",
    "encoder_eccentricity": "amplitude",
    "friction_coupling": "coulomb",
    "offset_drift": "rate",
    "vibration": "amplitude",
}
# Elasticity is the larger the smaller its parameter.
INVERSE = ("joint_elasticity",)
WHOLE_ARM = ("base_tilt", "payload_change", "time_delay")
UNLISTED = ("unlisted_1", "unlisted_2")
KINDS = (*SIZE, "none", "none", "none", "unlisted", "unlisted", "pair", "pair")


def random_arm(rng: np.random.Generator):
    """An arm like the SCARA03 with its own inertias and friction."""
    arm = virtual_arm(load_robot())
    scale = rng.uniform(0.85, 1.15, (arm.robot.n, 1))
    return replace(
        arm,
        bodies=arm.bodies * scale,
        rotor_inertia=arm.rotor_inertia * rng.uniform(0.9, 1.1, arm.robot.n),
        friction=arm.friction * rng.uniform(0.75, 1.25, (arm.robot.n, 1)),
        torque_offset=rng.normal(0.0, 0.005, arm.robot.n),
        torque_noise=np.array([0.020, 0.008]),
    )


def multisine(name: str, robot, seed: int, duration: float) -> ReferenceMotion:
    """A sum of five harmonics per joint with rest at both ends."""
    rng = np.random.default_rng(seed)
    order = np.arange(1, 6)
    amplitude = rng.normal(0.0, 1.0, (robot.n, 5)) / order
    phase = rng.uniform(0.0, 2.0 * np.pi, (robot.n, 5))
    centre = np.array([1.57, 0.0])
    omega = 2.0 * np.pi * order / duration
    t = np.linspace(0.0, duration, 400)
    wave = np.einsum("jk,jkt->jt", amplitude, np.cos(omega[:, None] * t + phase[:, :, None]))
    # Fill the ranges but stay under 2.5 rad/s.
    speed = np.einsum("jk,jkt->jt", amplitude * omega, -np.sin(omega[:, None] * t + phase[:, :, None]))
    reach = np.minimum(1.9 / np.abs(wave).max(axis=1), 2.5 / np.abs(speed).max(axis=1))
    amplitude = amplitude * reach[:, None]

    def motion(time_):
        angle = omega[:, None] * time_ + phase[:, :, None]
        q = centre[:, None] + np.einsum("jk,jkt->jt", amplitude, np.cos(angle))
        v = -np.einsum("jk,jkt->jt", amplitude * omega, np.sin(angle))
        a = -np.einsum("jk,jkt->jt", amplitude * omega**2, np.cos(angle))
        return q, v, a

    return sampled(name, robot, motion, duration)


def pick_effects(kind: str, arm, rng: np.random.Generator):
    """Return effects of a random size and the size factor."""
    names = {"none": [], "unlisted": [rng.choice(UNLISTED)]}.get(kind)
    if names is None:
        names = list(rng.choice(list(SIZE), 2, replace=False)) if kind == "pair" else [kind]
    effects, factors = [], []
    for name in names:
        joint = None if name in WHOLE_ARM else str(rng.choice(arm.robot.joints))
        if name == "torque_gain_mismatch":
            joint = arm.robot.joints[1]
        effect = EFFECTS[name](joint=joint).resolve(arm)
        factor = float(np.exp(rng.uniform(np.log(0.25), np.log(3.0)))) if kind != "pair" else 1.5
        key = SIZE.get(name)
        if name == "torque_gain_mismatch":
            effect = replace(effect, ratio=1.0 + factor * (effect.ratio - 1.0))
        elif name == "base_tilt":
            effect = replace(effect, tilt_x=factor * effect.tilt_x, tilt_y=factor * effect.tilt_y)
        elif name == "friction_coupling":
            effect = replace(effect, viscous=factor * effect.viscous, coulomb=factor * effect.coulomb)
        elif name in INVERSE:
            effect = replace(effect, stiffness=effect.stiffness / factor)
        elif key:
            value = factor * getattr(effect, key)
            effect = replace(effect, **{key: min(value, 0.9) if key in ("share", "loss_coefficient") else value})
        else:
            effect = replace(
                effect, **{k: factor * getattr(effect, k) for k in ("amplitude", "viscous") if hasattr(effect, k)}
            )
        if name == "payload_change":
            effect = replace(effect, time=float(rng.uniform(3.0, 7.0)))
        if name == "torque_ripple":
            effect = replace(effect, order=float(rng.choice([1.0, 2.0, 4.0, 6.0])))
        effects.append(effect)
        factors.append(factor)
    return effects, factors


@dataclass(frozen=True, eq=False)
class VirtualSet:
    """Recordings of one random arm, and what it was."""

    kind: str
    seed: int
    arm: VirtualArm
    effects: Sequence[Effect]
    factors: Sequence[float]
    training: Sequence[Recording]
    held_out: Sequence[Recording]


def simulate_set(kind: str, seed: int) -> VirtualSet:
    """Simulate eight recordings of four motions, and one to hold out."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    robot = arm.robot
    effects, factors = pick_effects(kind, arm, rng)
    motions = [
        sampled("OJD", robot, OJD.motion, 14.0),
        sampled("OJK", robot, OJK.motion, 10.0),
        multisine("F1", robot, seed + 10_000, 8.0),
        multisine("F2", robot, seed + 20_000, 12.0),
    ]
    training = [
        simulate(arm, motion, effects=effects, seed=seed, repetition=k).recording for motion in motions for k in (1, 2)
    ]
    test_motion = multisine("F3", robot, seed + 30_000, 10.0)
    held_out = [simulate(arm, test_motion, effects=effects, seed=seed + 1).recording]
    return VirtualSet(kind, seed, arm, effects, factors, training, held_out)


def tasks(count: int, seed: int, kinds: Sequence[str] = KINDS) -> list[tuple[str, int]]:
    """Return kind and seed of every set, the kinds in rotation."""
    return [(kinds[k % len(kinds)], seed * 100_000 + k) for k in range(count)]


def write_set(made: VirtualSet, folder: Path) -> None:
    """Write the recordings of a set, and last what the arm was."""
    for part, recordings in (("train", made.training), ("test", made.held_out)):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for recording in recordings:
            write_recording(recording, folder / part / f"{recording.name}.parquet")
    was = {"kind": made.kind, "seed": made.seed, "factors": list(made.factors)} | truth(made.arm, made.effects)
    (folder / "truth.json").write_text(json.dumps(was, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Write the sets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, help="folder of the sets; made if needed")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=9)
    arguments = parser.parse_args()
    for k, (kind, seed) in enumerate(tasks(arguments.count, arguments.seed)):
        folder = arguments.output / f"{k:03d}_{kind}"
        write_set(simulate_set(kind, seed), folder)
        print(folder, flush=True)


if __name__ == "__main__":
    main()
