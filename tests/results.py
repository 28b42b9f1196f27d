"""One result of every kind, of the virtual SCARA03: short recordings with a hidden spring."""

from __future__ import annotations

from dataclasses import dataclass

from scara_ident import (
    Comparison,
    Design,
    Diagnosis,
    Identification,
    Robot,
    SimulationResult,
    VirtualArm,
    build_model,
    compare,
    design_excitation,
    diagnose,
    identify,
    load_robot,
    named_motion,
    parse_effect,
    simulate,
    virtual_arm,
)
from scara_ident.effects import effects_named
from scara_ident.excitation.search import Effort


@dataclass(frozen=True, eq=False)
class Results:
    robot: Robot
    arm: VirtualArm
    runs: tuple[SimulationResult, ...]
    identification: Identification
    consistent: Identification
    diagnosis: Diagnosis
    comparison: Comparison
    design: Design


def made() -> Results:
    robot = load_robot()
    arm = virtual_arm(robot)
    hidden = [parse_effect("spring:joint1:stiffness=0.2")]
    asked = (("OJD", 1), ("OJD", 2), ("OJK", 1))
    runs = tuple(
        simulate(arm, named_motion(name, robot), effects=hidden, rate=250.0, repetition=k) for name, k in asked
    )
    *training, held_out = (run.recording for run in runs)
    bands = [25.0, 25.0]
    return Results(
        robot,
        arm,
        runs,
        identify(robot, training, validation=[held_out], bands=bands),
        identify(robot, training, method="consistent", bands=bands),
        diagnose(robot, training, validation=[held_out], bands=bands, catalogue=effects_named("spring")),
        compare(robot, [*training, held_out], bands=bands),
        design_excitation(build_model(robot), duration=5.0, harmonics=3, effort=Effort(starts=1, rounds=1)),
    )
