"""Recordings with an undeclared effect: what the diagnosis names, how often it is wrong, how small it can see.

Every set is a random arm like the SCARA03 in closed loop, with none, one or two effects or one outside the
catalogue, at a random size. The identifier is told nothing. Prints tables and writes JSON.

    python benchmarks/attribution.py --sets 300 --output benchmarks/results/attribution.json
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from attribution_tables import report

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.model_selection import joint_errors
from scara_ident.diagnosis.search import model_with
from scara_ident.effects import CATALOGUE, Member
from scara_ident.effects.measurement import shifted
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import gather_all
from scara_ident.paper import OJD, OJK
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import EFFECTS, ReferenceMotion, sampled, simulate, virtual_arm

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


def one_set(task: tuple[str, int]) -> dict:
    """Simulate a set, diagnose it, and compare with what the arm was."""
    kind, seed = task
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    robot = arm.robot
    effects, factors = pick_effects(kind, arm, rng)
    ojd = sampled("OJD", robot, OJD.motion, 14.0)
    ojk = sampled("OJK", robot, OJK.motion, 10.0)
    training_motions = [
        ojd,
        ojk,
        multisine("F1", robot, seed + 10_000, 8.0),
        multisine("F2", robot, seed + 20_000, 12.0),
    ]
    test_motion = multisine("F3", robot, seed + 30_000, 10.0)
    training = [
        simulate(arm, motion, effects=effects, seed=seed, repetition=k).recording
        for motion in training_motions
        for k in (1, 2)
    ]
    held_out = [simulate(arm, test_motion, effects=effects, seed=seed + 1).recording]
    began = time.perf_counter()
    result = diagnose(robot, "complete", training, held_out)
    seconds = time.perf_counter() - began
    before = [error.rms for error in joint_errors(result.before.value, result.validation_before)]
    after = [error.rms for error in joint_errors(result.after.value, result.validation_after)]
    return {
        "kind": kind,
        "seed": seed,
        "factors": factors,
        "true": [{"effect": e.name, "joint": e.joint, "parameters": e.as_dict()["parameters"]} for e in effects],
        "verdict": result.verdict,
        "found": [
            {
                "effect": e.effect,
                "joint": e.joint,
                "group": [confounder.effect for confounder in e.confounded_with],
                "parameters": {k: [p.value, p.std] for k, p in e.parameters.items()},
                "gain": e.gain,
            }
            for e in result.effects
        ],
        "unexplained": None if result.unexplained is None else result.unexplained.joint,
        "before": before,
        "after": after,
        "noise": {fit.joint: fit.noise for fit in result.fit_after},
        "missing": {fit.joint: fit.missing for fit in result.fit_after},
        "true_model": true_model_error(result, training, held_out, effects),
        "seconds": seconds,
    }


def true_model_error(result, training, held_out, effects) -> list[float] | None:
    """Held-out error of the same recordings fitted with the true model and its true nonlinear parameters."""
    scene, bands = result.search.scene, result.search.bands
    chosen, delay = [], 0.0
    for effect in effects:
        values = effect.as_dict()["parameters"]
        if effect.name == "time_delay":
            delay = values["delay"]
            continue
        # The family whose nonlinear parameters are those that the effect has.
        family = next(
            (
                f
                for f in CATALOGUE
                if f.name == effect.name and all(parameter.name in values for parameter in f.nonlinear)
            ),
            None,
        )
        if family is None:
            return None
        joint = None if effect.joint is None else scene.robot.joints.index(effect.joint)
        nonlinear = tuple(float(values[parameter.name]) for parameter in family.nonlinear if parameter.name in values)
        if len(nonlinear) != len(family.nonlinear):
            return None
        partner = None
        if effect.name == "friction_coupling":
            partner = 1 - joint
        chosen.append(Candidate(family, Member(joint, nonlinear, partner)))
    model = model_with(scene, chosen)
    fit = wls(model, gather_all(model, [shifted(item, delay) for item in training], bands))
    tested = gather_all(model, [shifted(item, delay) for item in held_out], bands)
    return [error.rms for error in joint_errors(fit.value, tested)]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--only", nargs="*", default=None, help="kinds to run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/attribution.json"))
    parser.add_argument("--tables", type=Path, help="print the tables of an earlier run's JSON and stop")
    arguments = parser.parse_args()
    if arguments.tables:
        report(json.loads(arguments.tables.read_text(encoding="utf-8")))
        return
    kinds = arguments.only or [*SIZE, "none", "none", "none", "unlisted", "unlisted", "pair", "pair"]
    tasks = [(kinds[k % len(kinds)], arguments.seed * 100_000 + k) for k in range(arguments.sets)]
    with ProcessPoolExecutor(max_workers=2) as pool:
        results = []
        for k, item in enumerate(pool.map(one_set, tasks)):
            results.append(item)
            found = ", ".join(f"{f['effect']}/{f['joint']}" for f in item["found"])
            true = ", ".join(f"{t['effect']}/{t['joint']}" for t in item["true"])
            factors = np.round(item["factors"], 2)
            print(
                f"{k + 1:4d} {true or '-'} {factors} -> {item['verdict']} {found or '-'} {item['seconds']:.1f} s",
                flush=True,
            )
    report(results)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
