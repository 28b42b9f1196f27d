"""``scara-ident simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import output_console, progress


def simulate(
    trajectory: Annotated[
        list[str],
        typer.Argument(metavar="TRAJECTORY...", help="trajectory.csv, or OJK, OJD, CI, L1, L2 on the SCARA03."),
    ],
    robot: options.Robot = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME[:JOINT][:KEY=VALUE,..]",
            help="Effect to switch on, such as spring:joint2:stiffness=0.05 or push:force=20,from=4.2,duration=0.8,"
            "direction=0/0/1,link=LINK; with recording=NAME it acts in that recording only. May be repeated.",
        ),
    ] = None,
    link_encoder: Annotated[
        list[str] | None,
        typer.Option(
            "--link-encoder", metavar="JOINT", help="Joint with a second encoder behind its gear; may be repeated."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise and of the encoder zeros.")] = 0,
    repetitions: Annotated[int, typer.Option(min=1, help="Number of recordings of each trajectory.")] = 1,
    output: Annotated[Path, typer.Option("--output", metavar="DIR", help="Folder for the recordings.")] = Path("."),
) -> None:
    """Record the virtual arm in closed loop, and write its true parameters and effects beside each recording as JSON."""
    from scara_ident.errors import UsageError
    from scara_ident.files import check_output, slug
    from scara_ident.manners import listed
    from scara_ident.robot.robot import load_robot
    from scara_ident.simulation import parse_effect, virtual_arm, write_simulation
    from scara_ident.simulation import simulate as simulate_run
    from scara_ident.simulation.first_run import compiled_first
    from scara_ident.simulation.named import named_motion

    check_output(output)
    arm = virtual_arm(load_robot(robot))
    effects = [parse_effect(text) for text in effect or ()]
    motions = [named_motion(word, arm.robot) for word in trajectory]
    for joint in link_encoder or ():
        arm.robot.joint_index(joint)
    # With different numbers they would count as repetitions of one motion.
    names = [slug(motion.name, "motion") for motion in motions]
    for name in names:
        if names.count(name) > 1:
            same = [word for word, other in zip(trajectory, names, strict=True) if other == name]
            raise UsageError(
                f"{listed(same, 3)}: all would be written to the same file {name}_1; rename a file, or use --repetitions to record a "
                "motion several times"
            )
    made = [f"{motion.name}_{run}" for motion in motions for run in range(1, repetitions + 1)]
    for each in effects:
        if each.recording not in (None, *made):
            raise UsageError(f"{each.name}: no recording {each.recording!r}; there will be {', '.join(made)}")
    console = output_console()
    with progress() as whole:
        work = compiled_first(arm, whole)
        for place, motion in enumerate(motions):
            for repetition in range(1, repetitions + 1):
                done = (place * repetitions + repetition - 1) / (len(motions) * repetitions)
                work(f"simulating {motion.name}, run {repetition}", done)
                result = simulate_run(
                    arm, motion, effects=effects, seed=seed, repetition=repetition, link_encoders=link_encoder or ()
                )
                path = write_simulation(result, output)
                console.written(output, path.name)
