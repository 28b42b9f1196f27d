"""``scara-ident identify``."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal

import typer

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, show_recordings, writing


def identify(
    recordings: options.Recordings,
    robot: options.Robot = None,
    model: options.Model = "complete",
    method: options.Method = "wls",
    friction: Annotated[
        Literal["auto", "lubricated", "dissipative", "free"],
        typer.Option(
            help="Constraint on friction, with --method consistent. lubricated: dissipates energy, and grows less and less "
            "with speed; dissipative: dissipates energy; free: no constraint; auto: lubricated if the data do not contradict "
            "it, else dissipative."
        ),
    ] = "auto",
    validate: options.Validate = None,
    band: options.Band = None,
    output: options.Output = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Estimate the parameters from recordings, and predict the torques of held-out recordings."""
    from scara_ident.cli.reading import read_beside
    from scara_ident.errors import UsageError
    from scara_ident.robot.robot import load_robot

    if friction != "auto" and method != "consistent":
        raise UsageError(f"--friction {friction}: needs --method consistent; {method} does not constrain friction")
    check_report(output, "identification")
    arm = load_robot(robot)
    with progress() as work:
        work("reading the recordings")
        with read_beside(arm, recordings, validate or ()) as wanted:
            from scara_ident.estimation.consistent.options import ConsistentOptions
            from scara_ident.files import write_json, write_text
            from scara_ident.identification.identify import identify as run
            from scara_ident.report.doubts import parted
            from scara_ident.report.identification import identification_dict
            from scara_ident.report.summaries.identification import bands_said, tables

            (training, useless), (held_out, more) = wanted()
        result = run(
            arm,
            training,
            model=model,
            method=method,
            validation=held_out,
            bands=None if band is None else [band] * arm.n,
            options=ConsistentOptions(friction=friction) if method == "consistent" else None,
            progress=work.part(READING_SHARE, 1.0),
        )
    content = identification_dict(result)
    console = result_console(content, json)
    if verbose:
        show_recordings(console, (*training, *held_out))
    first, others = parted(content)
    console.say(first)
    console.note([*useless, *more, *result.notes])
    for each in tables(result):
        console.print(each)
    console.print(bands_said(result))
    console.say(others)
    if output is not None:
        from scara_ident.export.identified_model import identified_model
        from scara_ident.export.robots import robot_files
        from scara_ident.processes import all_beside
        from scara_ident.report.html.identification import IdentificationContext, identification_report
        from scara_ident.report.pictures import torque_picture

        context = IdentificationContext(result)
        models, notes = robot_files(identified_model(result))
        console.note(notes)
        with writing(output) as (place, work):
            for name, text in models.items():
                write_text(place / name, text)
            work("drawing torque.png and report.html", 0.2)
            # Both show these.
            _ = context.groups
            all_beside(
                [
                    partial(torque_picture, place / "torque.png", context),
                    partial(identification_report, place / "report.html", context),
                ]
            )
            write_json(place / "identification.json", content)
        console.written(output, "identification.json", "report.html", "torque.png", *models)
