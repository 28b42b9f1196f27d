"""``scara-ident excite``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scara_ident.cli import options
from scara_ident.cli.console import check_report, progress, result_console, writing
from scara_ident.cli.joint_values import with_motion_limits

if TYPE_CHECKING:
    from scara_ident.excitation import Limits
    from scara_ident.robot.robot import Robot

# Share of a design that its searches take; the rest is the winner on the finer grid and the verification of limits.
SEARCHES_SHARE = 0.85


@with_motion_limits
def excite(
    robot: options.RobotOfEarlier = None,
    model: options.ModelIfGiven = None,
    criterion: Annotated[
        Literal["logdet", "cond"] | None,
        typer.Option(help="ln det (default) or the condition number of the stacked regressor."),
    ] = None,
    wanted: Annotated[
        list[str] | None,
        typer.Option(
            "--for",
            metavar="NAME",
            help="Parameter or term to determine best, all others being unknown too; may be repeated.",
        ),
    ] = None,
    tell: Annotated[
        Path | None,
        typer.Option(
            metavar="DIAGNOSIS",
            help="diagnosis.json: design the motion that best answers the questions it left open, for its model.",
        ),
    ] = None,
    duration: Annotated[
        list[float] | None,
        typer.Option(
            min=1.0,
            max=3600.0,
            help="Duration of each trajectory, s; repeated: of the first, the second, ... [default: 25]",
        ),
    ] = None,
    harmonics: Annotated[
        int | None,
        typer.Option(min=3, help="Harmonics per joint of the longest trajectory; default: from the duration."),
    ] = None,
    family: Annotated[
        Literal["fourier", "spline"], typer.Option(help="fourier: harmonics; spline: B-splines.")
    ] = "fourier",
    trajectories: Annotated[int, typer.Option(min=1, help="Number of trajectories that are designed together.")] = 1,
    known: Annotated[
        list[str] | None,
        typer.Option(
            "--known",
            metavar="RECORDING",
            help="Recording that exists already: the design adds what it lacks; may be repeated.",
        ),
    ] = None,
    asked_std: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PERCENT|NAME=STD",
            help="Say after which trajectory the parameters reach this standard deviation; may be repeated.",
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=RMS", help="Noise of a joint's torque below 50 Hz; default: the residual in --parameters."
        ),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="identification.json: its parameters, friction included, predict the torques."
        ),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,..", help="Start positions of all joints, rad or m.")
    ] = None,
    *,
    limits: Callable[[Robot], Limits],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random starts.")] = 0,
    starts: Annotated[
        int, typer.Option(min=1, help="Number of random starts; more take longer and may find a better motion.")
    ] = 8,
    rate: Annotated[float, typer.Option(min=1.0, max=1e5, help="Samples per second of trajectory.csv.")] = 1000.0,
    output: options.Folder = Path("."),
    json: options.Json = False,
) -> None:
    """Design an excitation trajectory within the limits of the joints, the motors and the tool."""
    import numpy as np

    from scara_ident.cli.joint_values import joint_numbers, numbers
    from scara_ident.cli.reading import read_beside
    from scara_ident.errors import UsageError
    from scara_ident.estimation.estimate import PAPER_SAMPLES
    from scara_ident.excitation import (
        Effort,
        Progress,
        block_of,
        default_harmonics,
        design_excitation,
        excitation_dict,
        nominal_parameters,
        write_joint_trajectory,
        write_trajectory,
    )
    from scara_ident.excitation.criteria import criterion_of
    from scara_ident.excitation.known import read_diagnosis, read_parameters
    from scara_ident.excitation.output import check_rate, file_names
    from scara_ident.excitation.size import SAMPLES, check_size, durations_of, harmonics_of
    from scara_ident.excitation.stopping import NOISE_BAND, noise_of, stopping
    from scara_ident.excitation.stopping import asked_std as read_asked
    from scara_ident.export.result import read_robot
    from scara_ident.files import write_json
    from scara_ident.identification.identify import known_information
    from scara_ident.inquiry.answerability import inquiry_of
    from scara_ident.model.model import build_model
    from scara_ident.report.html.excitation import excitation_report
    from scara_ident.report.pictures import design_picture
    from scara_ident.report.summaries.design import limit_table
    from scara_ident.robot.robot import load_robot

    check_report(output, "excitation")
    if tell is not None and wanted:
        raise UsageError("--for and --tell: these are two goals of one motion; give one of them")
    if tell is not None and (criterion is not None or model is not None):
        given = "--model" if criterion is None else "--criterion"
        raise UsageError(f"{given} and --tell: the diagnosis sets the criterion and the model; leave {given} out")
    if tell is not None and asked_std:
        raise UsageError("--asked-std and --tell: these are two goals of one motion; give one of them")
    if noise and not asked_std:
        raise UsageError("--noise is for --asked-std; give both")
    asked = None if tell is None else read_diagnosis(tell)
    earlier = tell or parameters
    arm = (read_robot(earlier) if robot is None and earlier is not None else None) or load_robot(robot)
    equation = build_model(arm, (model or "complete") if asked is None else str(asked["model"]))
    goal = None if asked is not None else criterion_of(criterion or "logdet", equation, wanted or ())
    place = numbers(start, "--start")
    within = limits(arm)
    durations = durations_of(duration or 25.0, trajectories)
    longest = max(durations)
    count = default_harmonics(longest, arm.n, len(durations)) if harmonics is None else harmonics
    for each in durations:
        own = harmonics_of(count, each / longest)
        check_size(own, arm.n, len(durations), round(SAMPLES * each / longest))
        check_rate(rate, own / each)
    known_from = parameters or tell
    nominal = None if known_from is None else read_parameters(known_from, equation)
    counted = PAPER_SAMPLES / longest
    std = None
    if asked_std:
        values = dict(zip(equation.names, nominal_parameters(equation, nominal).tolist(), strict=True))
        judged = [equation.names[k] for k in block_of(equation, wanted).columns] if wanted else equation.names
        aim, unjudged = read_asked(asked_std, {name: values[name] for name in judged})
        # As white noise at the samples that the design counts.
        std = noise_of(arm, joint_numbers(noise, "--noise"), parameters) * np.sqrt(0.5 * counted / NOISE_BAND)
    with progress() as work:
        work("reading what is known")
        with read_beside(arm, known or ()) as read:
            ((recorded, useless),) = read()
        weights = None if std is None else 1.0 / std
        prior = known_information(equation, recorded, counted, weights) if recorded else None
        inquiry = None if asked is None else inquiry_of(asked, arm, recorded)

        def on_progress(state: Progress) -> None:
            words = f"search {state.done} of {state.total} done, best so far {-state.cost:.2f}"
            work(words, SEARCHES_SHARE * state.done / state.total)

        work("search 1")
        design = design_excitation(
            equation,
            duration=durations,
            harmonics=count,
            criterion=goal,
            tell=inquiry,
            limits=within,
            known=nominal,
            trajectories=len(durations),
            torque_std=std,
            prior=prior,
            start=None if place is None else np.array(place),
            family=family,
            effort=Effort(starts=starts, seed=seed),
            progress=on_progress,
        )
    content = excitation_dict(design, stopping(design, aim, unjudged) if asked_std else None)
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
        motions = [design.motion(k, counted) for k in range(len(durations))]
        work("drawing report.html", 0.6)
        excitation_report(folder / "report.html", content, arm, motions)
        write_json(folder / "excitation.json", content)
    trajectory_files = (*file_names(design, ".csv"), *file_names(design, ".yaml"))
    console.written(output, *trajectory_files, "excitation.json", "report.html", "excitation.png")
