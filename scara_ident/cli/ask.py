"""``scara-ident ask``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import output_console, progress
from scara_ident.cli.joint_values import with_motion_limits

if TYPE_CHECKING:
    from scara_ident.excitation import Limits
    from scara_ident.robot.robot import Robot


@with_motion_limits
def ask(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with recordings/ in it; all results are kept there too.")
    ],
    robot: options.Robot = None,
    model: options.Model = "complete",
    duration: Annotated[float, typer.Option(min=1.0, max=3600.0, help="Duration of each motion to record, s.")] = 15.0,
    *,
    limits: Callable[[Robot], Limits],
    starts: Annotated[int, typer.Option(min=1, help="Number of random starts of each design.")] = 8,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random starts and of the virtual arm.")] = 0,
    virtual: Annotated[bool, typer.Option("--virtual", help="Let the virtual arm record the motions.")] = False,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect", metavar="NAME[:JOINT][:KEY=VALUE,..]", help="Effect that the virtual arm has; may be repeated."
        ),
    ] = None,
    steps: Annotated[int, typer.Option(min=1, help="Largest number of motions that the virtual arm records.")] = 4,
) -> None:
    """Diagnose the recordings so far, and design the next motion to record, which settles the questions they leave open."""
    from scara_ident.asking import Settings, beside_recordings, progress_in_words, recordings_in
    from scara_ident.asking import ask as run
    from scara_ident.errors import UsageError
    from scara_ident.excitation import Effort
    from scara_ident.files import check_output, written_together
    from scara_ident.robot.robot import load_robot

    if effect and not virtual:
        raise UsageError("--effect is an effect of the virtual arm; give --virtual with it")
    if not folder.exists():
        raise UsageError(f"{folder}: no such folder; create it, with recordings/ in it, or empty to get a first motion")
    if (folder / "recordings").is_file():
        raise UsageError(f"{folder / 'recordings'}: is a file; recordings must be in a folder of that name")
    check_output(folder)
    arm = load_robot(robot)
    within = limits(arm)
    settings = Settings(arm, model, duration, Effort(starts=starts, seed=seed), within)
    console = output_console()
    if not recordings_in(folder) and (aside := beside_recordings(folder)):
        console.note([f"{aside[0].name} is beside recordings/ and is not read: move it into recordings/"])
    made = 0
    while True:
        with progress() as work:
            found = run(folder, settings, work)
        console.note(found.left_out)
        if recordings_in(folder) and (folder / "diagnosis.json").is_file():
            console.print(progress_in_words(folder))
        console.print(found.words)
        if found.state == "record" and within.clearance is not None:
            console.note(within.clearance.notes)
        if not virtual or found.state != "record" or made >= steps:
            return
        from scara_ident.simulation import parse_effect, read_trajectory, simulate, virtual_arm, write_simulation
        from scara_ident.simulation.first_run import compiled_first

        real = virtual_arm(arm)
        asked = read_trajectory(folder / "next" / "trajectory.csv", arm)
        taken = {path.stem.rpartition("_")[0] for path in recordings_in(folder)}
        name = next(word for word in (f"asked{k}" for k in count(1)) if word not in taken)
        with progress() as whole, written_together(folder / "recordings") as place:
            work = compiled_first(real, whole)
            for repetition in (1, 2):
                work(f"simulating {name}, run {repetition}", 0.5 * (repetition - 1))
                done = simulate(
                    real, replace(asked, name=name), effects=[parse_effect(text) for text in effect or ()], seed=seed,
                    repetition=repetition,
                )  # fmt: skip
                write_simulation(done, place)
        console.written(folder / "recordings", f"{name}_1.parquet", f"{name}_2.parquet")
        made += 1
