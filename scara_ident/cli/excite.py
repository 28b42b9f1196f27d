"""``scara-ident excite``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scara_ident.cli import options
from scara_ident.cli.console import check_report, progress, result_console, writing

# Share of a design that its searches take; the rest is the verification of limits.
SEARCHES_SHARE = 0.97


def excite(
    robot: options.Robot = None,
    model: options.Model = "complete",
    criterion: Annotated[
        Literal["logdet", "cond"], typer.Option(help="ln det or the condition of the stacked regressor.")
    ] = "logdet",
    wanted: Annotated[
        list[str] | None,
        typer.Option("--for", metavar="NAME", help="Parameter or term to tell from all others; may be repeated."),
    ] = None,
    tell: Annotated[
        Path | None,
        typer.Option(
            metavar="DIAGNOSIS", help="diagnosis.json: the motion that best answers what it left open, of its model."
        ),
    ] = None,
    duration: Annotated[float, typer.Option(min=1.0, max=3600.0, help="Of each trajectory, s.")] = 25.0,
    harmonics: Annotated[int | None, typer.Option(min=3, help="Per joint; default: by the duration.")] = None,
    family: Annotated[Literal["fourier", "spline"], typer.Option(help="Harmonics, or B-splines.")] = "fourier",
    trajectories: Annotated[int, typer.Option(min=1, help="How many are designed together.")] = 1,
    known: Annotated[
        list[str] | None,
        typer.Option("--known", metavar="RECORDING", help="Recordings at hand: the design fills what they lack."),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="identification.json to foresee torques with, friction included."),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,..", help="Positions of all joints to start at, rad or m.")
    ] = None,
    ranges: Annotated[
        list[str] | None, typer.Option("--range", metavar="JOINT=LOWER..UPPER", help="Instead of the URDF's, rad or m.")
    ] = None,
    velocities: Annotated[
        list[str] | None, typer.Option("--velocity", metavar="JOINT=V", help="Instead of the URDF's, rad/s or m/s.")
    ] = None,
    torques: Annotated[
        list[str] | None,
        typer.Option("--torque", metavar="JOINT=T", help="Instead of the URDF's, on the recorded side."),
    ] = None,
    share: Annotated[float, typer.Option(help="Share of ranges, velocities and torques to use.")] = 1.0,
    tool: Annotated[str | None, typer.Option(metavar="LINK", help="Link whose origin is the tool.")] = None,
    tool_acceleration: Annotated[
        float | None, typer.Option(metavar="A", help="Most, m/s^2; default: 9 on the SCARA03, else no limit.")
    ] = None,
    tool_speed: Annotated[float | None, typer.Option(metavar="V", help="Most, m/s.")] = None,
    floor: Annotated[float | None, typer.Option(metavar="Z", help="Height the tool stays above, m.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random starts.")] = 0,
    starts: Annotated[int, typer.Option(min=1, help="Random starts; more take longer and may find better.")] = 8,
    rate: Annotated[float, typer.Option(min=1.0, max=1e5, help="Samples per second of trajectory.csv.")] = 1000.0,
    output: options.Folder = Path("."),
    json: options.Json = False,
) -> None:
    """Design an excitation trajectory within the limits of the joints, the motors and the tool."""
    import numpy as np

    from scara_ident.cli.joint_values import joint_numbers, joint_ranges, numbers
    from scara_ident.diagnosis.answerability import inquiry_of
    from scara_ident.errors import UsageError
    from scara_ident.estimation.estimate import PAPER_SAMPLES
    from scara_ident.excitation import (
        Effort,
        Progress,
        default_harmonics,
        design_excitation,
        excitation_dict,
        limits_of,
        write_joint_trajectory,
        write_trajectory,
    )
    from scara_ident.excitation.criteria import criterion_of
    from scara_ident.excitation.design import SAMPLES, check_size
    from scara_ident.excitation.known import read_diagnosis, read_parameters
    from scara_ident.excitation.output import check_rate, file_names
    from scara_ident.files import write_json
    from scara_ident.identification.identify import known_information
    from scara_ident.model.model import build_model
    from scara_ident.recording.recording import read_usable
    from scara_ident.report.html import excitation_report
    from scara_ident.report.pictures import design_picture
    from scara_ident.report.told.design import limit_table
    from scara_ident.robot.robot import load_robot

    check_report(output, "excitation")
    arm = load_robot(robot)
    if tell is not None and wanted:
        raise UsageError("--for and --tell: two goals of one motion; give one of them")
    asked = None if tell is None else read_diagnosis(tell)
    equation = build_model(arm, model if asked is None else str(asked["model"]))
    goal = None if asked is not None else criterion_of(criterion, equation, wanted or ())
    place = numbers(start, "--start")
    limits = limits_of(
        arm,
        ranges=joint_ranges(ranges, "--range"),
        velocities=joint_numbers(velocities, "--velocity"),
        torques=joint_numbers(torques, "--torque"),
        tool_acceleration=tool_acceleration,
        tool_speed=np.inf if tool_speed is None else tool_speed,
        floor=-np.inf if floor is None else floor,
        tool=tool,
        share=share,
    )
    count = default_harmonics(duration, arm.n, trajectories) if harmonics is None else harmonics
    check_size(count, arm.n, trajectories, SAMPLES)
    check_rate(rate, count / duration)
    nominal = None if parameters is None else read_parameters(parameters, equation)
    with progress() as work:
        work("reading what is known")
        recorded, useless = read_usable(known or (), arm)
        prior = known_information(equation, recorded, PAPER_SAMPLES / duration) if recorded else None
        inquiry = None if asked is None else inquiry_of(asked, arm, recorded)

        def told(state: Progress) -> None:
            words = f"search {state.done} of {state.total} done, best so far {-state.cost:.2f}"
            work(words, SEARCHES_SHARE * state.done / state.total)

        work("search 1")
        design = design_excitation(
            equation,
            duration=duration,
            harmonics=count,
            criterion=goal,
            tell=inquiry,
            limits=limits,
            known=nominal,
            trajectories=trajectories,
            prior=prior,
            start=None if place is None else np.array(place),
            family=family,
            effort=Effort(starts=starts, seed=seed),
            progress=told,
        )
    content = excitation_dict(design)
    console = result_console(content, json)
    console.say(content["summary"])
    console.print(limit_table(design))
    console.note([*useless, *content["notes"]])
    with writing(output) as (folder, work):
        for trajectory, csv, yaml in zip(
            design.trajectories, file_names(design, ".csv"), file_names(design, ".yaml"), strict=True
        ):
            write_trajectory(trajectory, folder / csv, rate)
            write_joint_trajectory(trajectory, folder / yaml)
        work("drawing excitation.png", 0.1)
        design_picture(folder / "excitation.png", design)
        motions = [design.motion(k, PAPER_SAMPLES / duration) for k in range(trajectories)]
        work("drawing report.html", 0.6)
        excitation_report(folder / "report.html", content, arm, motions)
        write_json(folder / "excitation.json", content)
    trajectory_files = (*file_names(design, ".csv"), *file_names(design, ".yaml"))
    console.written(output, *trajectory_files, "excitation.json", "report.html", "excitation.png")
