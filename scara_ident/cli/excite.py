"""``scara-ident excite``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scara_ident.cli.console import JsonOption, RobotOption, output_console, print_json, progress, table


def excite(
    robot: RobotOption = None,
    model: Annotated[
        Literal["complete", "reduced", "basic"], typer.Option(help="Model whose parameters are to be told.")
    ] = "complete",
    criterion: Annotated[
        Literal["logdet", "cond"], typer.Option(help="ln det or the condition of the stacked regressor.")
    ] = "logdet",
    duration: Annotated[float, typer.Option(min=1.0, max=3600.0, help="Of each trajectory, s.")] = 25.0,
    harmonics: Annotated[int | None, typer.Option(min=3, help="Per joint; default: by the duration.")] = None,
    trajectories: Annotated[int, typer.Option(min=1, help="How many are designed together.")] = 1,
    known: Annotated[
        list[str] | None,
        typer.Option("--known", metavar="RECORDING", help="Recordings at hand: the design fills what they lack."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random starts.")] = 0,
    starts: Annotated[int, typer.Option(min=1, help="Random starts; more take longer and may find better.")] = 8,
    rate: Annotated[float, typer.Option(min=1.0, max=1e5, help="Samples per second of trajectory.csv.")] = 1000.0,
    output: Annotated[Path, typer.Option("--output", metavar="DIR", help="Folder for the results.")] = Path("."),
    json: JsonOption = False,
) -> None:
    """Design an excitation trajectory within the limits of the joints, the motors and the tool."""
    from scara_ident.estimators.estimate import PAPER_SAMPLES
    from scara_ident.excitation import (
        Condition,
        Effort,
        LogDet,
        Progress,
        design_excitation,
        excitation_dict,
        write_joint_trajectory,
        write_preview,
        write_trajectory,
    )
    from scara_ident.excitation.output import file_names
    from scara_ident.identification import known_information
    from scara_ident.model import build_model
    from scara_ident.recording import read_recordings
    from scara_ident.report.files import check_output, write_json, written_together
    from scara_ident.report.html import excitation_report
    from scara_ident.robot import load_robot

    check_output(output)
    arm = load_robot(robot)
    equation = build_model(arm, model)
    prior = known_information(equation, read_recordings(known, arm), PAPER_SAMPLES / duration) if known else None
    with progress() as step:

        def told(state: Progress) -> None:
            step(f"search {state.done} of {state.total}, best so far {-state.cost:.2f}")

        design = design_excitation(
            equation,
            duration=duration,
            harmonics=harmonics,
            criterion=LogDet() if criterion == "logdet" else Condition(),
            trajectories=trajectories,
            prior=prior,
            effort=Effort(starts=starts, seed=seed),
            progress=told,
        )
    content = excitation_dict(design)
    if json:
        print_json(content)
    console = output_console(quiet=json)
    for sentence in content["summary"]:
        console.print(sentence, markup=False)
    limits = table("limits", "limit", "bound", "reached", right=("bound", "reached"))
    for each in design.reached:
        limits.add_row(each.name, f"{each.bound:.4g} {each.unit}", f"{each.reached:.4g} {each.unit}")
    console.print(limits)
    with written_together(output) as place:
        for trajectory, csv, yaml in zip(
            design.trajectories, file_names(design, ".csv"), file_names(design, ".yaml"), strict=True
        ):
            write_trajectory(trajectory, place / csv, rate)
            write_joint_trajectory(trajectory, place / yaml)
        write_preview(design, place / "excitation.png")
        excitation_report(place / "report.html", content, arm, [each.motion(2500) for each in design.trajectories])
        write_json(place / "excitation.json", content)
    names = (*file_names(design, ".csv"), "excitation.json", "report.html", "excitation.png")
    written = ", ".join(str(output / name) for name in names)
    console.print(f"written: {written}", markup=False, soft_wrap=True)
