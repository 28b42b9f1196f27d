"""Recordings of random arms in closed loop, with none, one, two or three effects or one outside the catalogue.

Any robot of example-robot-data, or the SCARA03: its masses, friction and rotors are drawn about what its URDF says; then
the effects and their sizes, the conditions (see `virtual_conditions`) and the motions (see `virtual_motions`). Written as
folders that the command line reads, so that any two commits can be compared on the same recordings: ``train`` and
``test`` of every set, ``robot.yaml`` but for the SCARA03, with what the arm was in ``truth.json``. The same seed gives the
same recordings; what is asked for instead of drawn leaves all other draws as they are.

    python benchmarks/virtual_sets.py SETS --count 60
    python benchmarks/virtual_sets.py SETS --robot ur5 --count 2 --only none --bits 17 --rate 500
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np
import yaml
from numpy.typing import NDArray
from virtual_conditions import Asked, Conditions, Noise, Start, draw_conditions, draw_lead, draw_states
from virtual_events import draw_events, event_truth
from virtual_motions import after_rest, random_motion, refuse_shaking

from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.recording.recording import Recording, split_name, write_recording
from scara_ident.robot.examples import example_urdf
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import (
    EFFECTS,
    Effect,
    ReferenceMotion,
    RunState,
    TorqueNoise,
    VirtualArm,
    parse_effect,
    simulate,
    virtual_arm,
)
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.truth import truth

T = TypeVar("T")
# Every effect, with the parameter that a random factor scales its size by.
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
# Drawn only where asked for, so that seeds keep their sets.
WHERE_ASKED = {"smooth_coulomb": "velocity"}
# Elasticity is the larger the smaller its parameter.
INVERSE = ("joint_elasticity",)
WHOLE_ARM = ("base_tilt", "payload_change", "time_delay")
# Effects between joints: an arm of one joint has none.
OF_TWO_JOINTS = ("torque_gain_mismatch", "friction_coupling")
UNLISTED = ("unlisted_1", "unlisted_2")
SEVERAL = {"pair": 2, "triple": 3}
KINDS = (*SIZE, "none", "none", "none", "unlisted", "unlisted", "pair", "pair", "triple")
# Size factors of single effects, evenly in their logarithm, and the factor of several at once.
FACTORS, FACTOR_OF_SEVERAL = (0.25, 3.0), 1.5
SHARES = ("share", "loss_coefficient")
# Reductions of joints whose description states them.
REDUCTIONS = (50.0, 80.0, 100.0, 120.0, 160.0)
# Coulomb friction of an arm other than the SCARA03, as a share of the joint's effort limit, and viscous friction at
# 1 rad/s as a multiple of it: gears of such arms have about this (Gaz et al. 2019 on the Panda).
COULOMB_SHARE, VISCOUS_RATIO = (0.01, 0.04), (0.3, 1.2)
# Controllers are up to this many times as fast as the virtual arm's own; with coarse encoders they would only shake.
FASTEST, COARSE = 2.5, 15
SLOWER, ATTEMPTS = 0.6, 5
GRIPPERS = ("finger", "gripper")


@dataclass(frozen=True, eq=False)
class VirtualSet:
    """Recordings of one random arm, and what it was."""

    kind: str
    seed: int
    arm: VirtualArm
    # As the identifier is told of it.
    robot: Robot
    effects: Sequence[Effect]
    factors: Sequence[float]
    conditions: Conditions
    states: Sequence[RunState]
    training: Sequence[Recording]
    held_out: Sequence[Recording]
    # Only where they are asked for.
    events: Sequence[dict[str, Any]] | None = None

    def truth(self) -> dict[str, Any]:
        """Return what the arm was, and how each recording differed from it."""
        runs = [
            {
                "recording": recording.name,
                "friction": state.friction.tolist(),
                "torque_scale": state.torque_scale.tolist(),
                "torque_offset": state.torque_offset.tolist(),
                "delay": state.delay,
            }
            for recording, state in zip((*self.training, *self.held_out), self.states, strict=True)
        ]
        was: dict[str, Any] = {"kind": self.kind, "seed": self.seed, "factors": list(self.factors)}
        if self.events is not None:
            was["events"] = self.events
        return was | {"conditions": self.conditions.as_dict(), "runs": runs} | truth(self.arm, self.effects)


def arm_joints(robot: Robot) -> list[str]:
    """Return the joints that are not those of a gripper; all, of a robot that is a finger."""
    found = [name for name in robot.joints if not any(word in name for word in GRIPPERS)]
    return found or list(robot.joints)


def random_arm(name: str, stated: bool, bits: int, folder: Path, rng: np.random.Generator) -> tuple[VirtualArm, Robot]:
    """Draw an arm, and describe it as the identifier is told of it, in ``folder`` but for the SCARA03."""
    reductions = rng.choice(REDUCTIONS, size=32)
    if name == "scara03":
        robot = load_robot()
    else:
        known = load_robot(name)
        joints = arm_joints(known)
        described = {joint: {"reduction": float(reductions[k])} if stated else {} for k, joint in enumerate(joints)}
        robot = _described(name, described, folder)
    arm = virtual_arm(robot)
    n = robot.n
    bodies, rotors = rng.uniform(0.85, 1.15, (n, 1)), rng.uniform(0.5, 1.5, n)
    friction, scale = arm.friction * rng.uniform(0.75, 1.25, (n, 1)), arm.torque_scale
    shares = rng.uniform(*COULOMB_SHARE, n), rng.uniform(*VISCOUS_RATIO, n)
    if name == "scara03":
        rotors = 0.8 + 0.2 * rotors
    else:
        rated = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 5.0 * scale)
        coulomb = shares[0] * rated
        viscous = shares[1] * coulomb / np.where(robot.prismatic, 0.3, 1.0)
        friction = np.column_stack([coulomb, viscous, np.zeros((n, 2))])
        scale = np.hypot(scale, coulomb)
    # The sixth digit is what a description has.
    rotor_inertia = np.array([float(f"{value:.6g}") for value in arm.rotor_inertia * rotors])
    faster = rng.uniform(1.0, FASTEST) if bits == 0 or bits > COARSE else 1.0
    offset = 0.02 * rng.normal(size=n) * scale
    arm = replace(
        arm,
        bodies=arm.bodies * bodies,
        rotor_inertia=rotor_inertia,
        friction=friction,
        torque_offset=offset,
        torque_scale=scale,
        controller=arm.controller.faster(faster),
        encoder_steps=np.full(n, 2.0**bits if bits else 0.0) / np.abs(robot.reduction),
    )
    if stated and name != "scara03":
        for joint, value in zip(robot.joints, rotor_inertia, strict=True):
            described[joint]["rotor_inertia"] = float(value)
        robot = _described(name, described, folder)
        arm = replace(arm, robot=robot)
    return arm, robot


def _described(name: str, joints: dict[str, dict[str, float]], folder: Path) -> Robot:
    """Write a description beside a copy of its URDF, and load it."""
    source = Path(name) if Path(name).suffix else example_urdf(name)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / source.name).write_bytes(source.read_bytes())
    content = {"urdf": source.name, "effort_side": "joint", "joints": joints}
    (folder / "robot.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return load_robot(folder / "robot.yaml")


def pick_effects(kind: str, arm: VirtualArm, rng: np.random.Generator) -> tuple[list[Effect], list[float]]:
    """Return effects of a random size and the size factors."""
    if kind == "none":
        names = []
    elif kind == "unlisted":
        names = [str(rng.choice(UNLISTED))]
    elif kind in SEVERAL:
        possible = [name for name in SIZE if arm.robot.n > 1 or name not in OF_TWO_JOINTS]
        names = [str(name) for name in rng.choice(possible, SEVERAL[kind], replace=False)]
    else:
        names = [kind]
    effects, factors = [], []
    for name in names:
        factor = float(np.exp(rng.uniform(*np.log(FACTORS)))) if kind not in SEVERAL else FACTOR_OF_SEVERAL
        effects.append(random_effect(name, factor, arm, rng))
        factors.append(factor)
    return effects, factors


def random_effect(name: str, factor: float, arm: VirtualArm, rng: np.random.Generator) -> Effect:
    """Draw an effect of a kind, of a factor times its usual size, on any joint that may have it."""
    joint = None if name in WHOLE_ARM else str(rng.choice(arm.robot.joints))
    if arm.robot.n < 2 and name in OF_TWO_JOINTS:
        raise UsageError(f"{name}: {arm.robot.name} has one joint; it needs two")
    if name == "torque_gain_mismatch":
        joint = str(rng.choice(arm.robot.joints[1:]))
    effect: Any = EFFECTS[name](joint=joint).resolve(arm)
    if name == "torque_gain_mismatch":
        return replace(effect, ratio=1.0 + factor * (effect.ratio - 1.0))
    if name == "base_tilt":
        return replace(effect, tilt_x=factor * effect.tilt_x, tilt_y=factor * effect.tilt_y)
    if name == "friction_coupling":
        return replace(effect, viscous=factor * effect.viscous, coulomb=factor * effect.coulomb)
    if name in INVERSE:
        return replace(effect, stiffness=effect.stiffness / factor)
    sizes = SIZE | WHERE_ASKED
    keys = [sizes[name]] if name in sizes else [key for key in ("amplitude", "viscous") if hasattr(effect, key)]
    values = {key: factor * getattr(effect, key) for key in keys}
    effect = replace(effect, **{key: min(value, 0.9) if key in SHARES else value for key, value in values.items()})
    if name == "payload_change":
        effect = replace(effect, time=float(rng.uniform(1.5, 4.0)))
    if name == "torque_ripple":
        effect = replace(effect, order=float(rng.choice([1.0, 2.0, 4.0, 6.0])))
    return effect


# Nothing is asked: all conditions are drawn.
ANYTHING = Asked()


def simulate_set(
    kind: str,
    seed: int,
    robot: str = "scara03",
    folder: Path = Path("output/virtual"),
    asked: Asked = ANYTHING,
    given: Sequence[Effect] = (),
) -> VirtualSet:
    """Draw and simulate a set.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
    robot : str
        ``scara03``, a robot of example-robot-data or a URDF.
    folder : Path
        For the description of a robot other than the SCARA03.
    asked : Asked
        Conditions that are not drawn.
    given : sequence of Effect
        Instead of drawn ones.
    """
    arms, sorts, sizes, moves, states, meets = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(6))
    conditions = draw_conditions(sorts, asked)
    arm, described = random_arm(robot, conditions.stated, conditions.bits, folder, arms)
    effects, factors = (list(given), [1.0] * len(given)) if given else pick_effects(kind, arm, sizes)
    motions: dict[int, ReferenceMotion] = {}
    for run in conditions.runs:
        if run.motion not in motions:
            name = f"{'T' if run.held_out else 'M'}{run.motion + 1}"
            motions[run.motion] = random_motion(name, arm, run.kind, run.duration, moves)
    usual = usual_torque(arm, [motions[run.motion] for run in conditions.runs if not run.held_out])
    arm = replace(arm, torque_noise=conditions.noise * usual)
    drawn = draw_states(states, arm, conditions, usual)
    leads = [draw_lead(states, conditions) for _ in conditions.runs]
    moved = [after_rest(motions[run.motion], lead) for run, lead in zip(conditions.runs, leads, strict=True)]
    met = draw_events(meets, arm, moved) if asked.events else [()] * len(moved)
    arm, (recordings, events) = under_control(
        arm, lambda arm: _recorded(arm, moved, conditions, effects, drawn, met, seed)
    )
    count = sum(not run.held_out for run in conditions.runs)
    return VirtualSet(
        kind, seed, arm, described, effects, factors, conditions, drawn, recordings[:count], recordings[count:],
        events if asked.events else None,
    )  # fmt: skip


def under_control(arm: VirtualArm, record: Callable[[VirtualArm], T]) -> tuple[VirtualArm, T]:
    """Return what an arm records, and the arm with a controller that holds it."""
    for _ in range(ATTEMPTS):
        try:
            return arm, record(arm)
        except ScaraIdentError as error:
            # An elastic joint, or a light one, may be more than a fast controller can hold, as on a real arm: then a slower
            # one is taken.
            lost, arm = error, replace(arm, controller=arm.controller.faster(SLOWER))
    raise lost


def _recorded(
    arm: VirtualArm,
    moved: Sequence[ReferenceMotion],
    conditions: Conditions,
    effects: Sequence[Effect],
    drawn: Sequence[RunState],
    met: Sequence[Sequence[Effect]],
    seed: int,
) -> tuple[list[Recording], list[dict[str, Any]]]:
    noise = TorqueNoise(conditions.noise_kind, conditions.correlation_time)
    recordings, events = [], []
    for k, (run, state, motion, own) in enumerate(zip(conditions.runs, drawn, moved, met, strict=True)):
        result = simulate(
            arm, motion, effects=[*effects, *own], seed=seed, repetition=run.repetition,
            rate=conditions.rate, ticks=conditions.ticks, averaged=conditions.averaged, noise=noise, run=state,
        )  # fmt: skip
        refuse_shaking(motion, result.true.acceleration)
        name = f"run_{k + 1:02d}" if conditions.numbered else result.recording.name
        trajectory, repetition = split_name(name)
        position = scattered(result.recording.position, arm.encoder_resolution, conditions.scatter, (seed, k))
        recordings.append(
            replace(result.recording, name=name, trajectory=trajectory, repetition=repetition, position=position)
        )
        events += [event_truth(arm, event, result, name) for event in own]
    return recordings, events


def scattered(
    position: NDArray[np.float64], resolution: NDArray[np.float64], scatter: float, seed: Sequence[int]
) -> NDArray[np.float64]:
    """Return positions, shape (n, N), that are off by whole steps of their encoders, with a standard deviation of so many."""
    steps = np.rint(scatter * np.random.default_rng(seed).standard_normal(position.shape))
    return position + resolution[:, None] * steps


def usual_torque(arm: VirtualArm, motions: Sequence[ReferenceMotion]) -> NDArray[np.float64]:
    """Return the rms torque of each joint along motions, on the effort side, shape (n,)."""
    square = []
    for motion in motions:
        signals = (x[:, ::10] for x in (motion.position, motion.velocity, motion.acceleration))
        square.append(inverse_dynamics(arm, arm.bodies, *signals) ** 2)
    return np.sqrt(np.concatenate(square, axis=1).mean(axis=1)) * np.abs(arm.robot.row_scale)


def tasks(count: int, seed: int, kinds: Sequence[str] = KINDS) -> list[tuple[str, int]]:
    """Return kind and seed of every set, the kinds in rotation."""
    return [(kinds[k % len(kinds)], seed * 100_000 + k) for k in range(count)]


def write_set(made: VirtualSet, folder: Path) -> None:
    """Write the recordings of a set, and last what the arm was."""
    for part, recordings in (("train", made.training), ("test", made.held_out)):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for recording in recordings:
            write_recording(recording, folder / part / f"{recording.name}.parquet")
    (folder / "truth.json").write_text(json.dumps(made.truth(), indent=1) + "\n", encoding="utf-8")


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Add the options that ask for conditions instead of drawing them."""
    parser.add_argument("--rate", type=float, help="samples per second")
    parser.add_argument("--bits", type=int, help="encoder steps per joint turn as a power of 2; 0 for none")
    parser.add_argument("--noise", type=float, help="share of the joint's rms torque")
    parser.add_argument("--noise-kind", choices=get_args(Noise))
    parser.add_argument("--stated", action=argparse.BooleanOptionalAction, help="reductions and rotor inertias")
    parser.add_argument("--averaged", action=argparse.BooleanOptionalAction, help="torque over a sample, or at a tick")
    parser.add_argument("--start", choices=get_args(Start), help="when recordings begin")
    parser.add_argument("--recordings", type=int, help="number of training recordings")
    parser.add_argument("--motions", type=int, help="number of different ones among them")
    parser.add_argument("--duration", type=float, nargs=2, help="s, least and most")
    parser.add_argument("--varied", action=argparse.BooleanOptionalAction, help="whether runs differ")
    parser.add_argument("--scatter", type=float, default=0.0, help="noise of positions beside the steps, in steps")
    parser.add_argument("--events", action="store_true", help="pushes and a payload in some recordings")


def asked_for(options: argparse.Namespace) -> Asked:
    """Return what the options of `add_conditions` ask for."""
    return Asked(**{name: getattr(options, name) for name in Asked.__dataclass_fields__})


def main() -> None:
    """Write the sets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, help="folder of the sets; made if needed")
    parser.add_argument("--robot", default="scara03", help="scara03, a robot of example-robot-data or a URDF")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=9)
    parser.add_argument("--only", nargs="*", choices=sorted(set(KINDS)), help="kinds to draw")
    parser.add_argument("--effect", nargs="*", default=(), metavar="NAME:JOINT:KEY=VALUE", help="instead of drawn ones")
    add_conditions(parser)
    options = parser.parse_args()
    given = [parse_effect(text) for text in options.effect]
    for k, (kind, seed) in enumerate(tasks(options.count, options.seed, options.only or KINDS)):
        folder = options.output / f"{k:03d}_{'_'.join(effect.name for effect in given) or kind}"
        try:
            write_set(simulate_set(kind, seed, options.robot, folder, asked_for(options), given), folder)
            print(folder, flush=True)
        except UsageError as error:
            print(f"{folder} was not simulated: {error}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
