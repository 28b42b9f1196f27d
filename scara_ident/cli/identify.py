"""``scara-ident identify``."""

from __future__ import annotations

from itertools import chain
from math import isnan
from typing import Annotated, Literal

import typer

from scara_ident.cli import options
from scara_ident.cli.console import (
    READING_SHARE,
    check_report,
    number,
    progress,
    result_console,
    show_recordings,
    table,
)


def identify(
    recordings: options.Recordings,
    robot: options.Robot = None,
    model: options.Model = "complete",
    method: options.Method = "wls",
    friction: Annotated[
        Literal["auto", "lubricated", "dissipative", "free"],
        typer.Option(
            help="Friction of the method consistent. lubricated: takes energy out, grows and flattens; dissipative: takes "
            "energy out; free: anything; auto: lubricated where the data do not contradict it, else dissipative."
        ),
    ] = "auto",
    validate: options.Validate = None,
    band: options.Band = None,
    output: options.Output = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Estimate the parameters from recordings and predict torques that were not fitted."""
    from scara_ident.estimation.consistent.options import ConsistentOptions
    from scara_ident.files import write_json, written_together
    from scara_ident.identification.identify import identified_arm
    from scara_ident.identification.identify import identify as run
    from scara_ident.recording.recording import read_usable
    from scara_ident.report.identification import identification_dict, sentences
    from scara_ident.robot.robot import load_robot

    check_report(output, "identification")
    arm = load_robot(robot)
    with progress() as work:
        work("reading the recordings")
        training, useless = read_usable(recordings, arm)
        held_out, more = read_usable(validate or (), arm, needed=False)
        result = run(
            arm,
            training,
            model=model,
            method=method,
            validation=held_out,
            bands=None if band is None else [band] * arm.n,
            options=ConsistentOptions(friction=friction),
            progress=work.part(READING_SHARE, 1.0),
        )
    content = identification_dict(result)
    console = result_console(content, json)
    if verbose:
        show_recordings(console, (*training, *held_out))
    console.note([*useless, *more, *result.notes])
    parameters = table(
        f"{arm.name}: {model} model by {method}",
        *("name", "value", "std", "URDF", "unit", "meaning"),
        right=("value", "std", "URDF"),
    )
    for row, value, std in zip(content["parameters"], result.estimate.value, result.estimate.std, strict=True):
        stated = "-" if isnan(row["urdf"]) else f"{row['urdf']:.4g}"
        parameters.add_row(row["name"], number(value, std), f"{std:.2g}", stated, row["unit"], row["meaning"])
    console.print(parameters)
    for title, found in (("fitted", result.training_errors()), ("held out", result.validation_errors())):
        if not found:
            continue
        columns = ("rms", "of torque", "unfiltered")
        errors = table(f"rms error within the band, recordings {title}", "recording", "joint", *columns, right=columns)
        for name, joints in found.items():
            for joint, error in zip(arm.joints, joints, strict=True):
                if error is None:
                    errors.add_row(name, joint, "-", "at rest", "-")
                    continue
                share = "-" if error.relative is None else f"{error.relative:.1%}"
                errors.add_row(name, joint, f"{error.rms:.3g}", share, f"{error.rms_unfiltered:.3g}")
        console.print(errors)
    bands = ", ".join(
        f"{joint} {'none' if cut is None else f'{cut:.3g} Hz'}"
        for joint, cut in zip(arm.joints, result.bands, strict=True)
    )
    console.print(f"band: {bands}; J_d {result.log_det:.2f}, J_k {result.condition:.3g}")
    console.say(sentences(result))
    if output is not None:
        from scara_ident.export.robots import export_mjcf, export_urdf
        from scara_ident.report.html import IdentificationContext, identification_report
        from scara_ident.report.pictures import torque_picture

        arm_found = identified_arm(result)
        context = IdentificationContext(result)
        urdf, mjcf = f"{arm.name}_identified.urdf", f"{arm.name}_identified.xml"
        with written_together(output) as place:
            if arm_found is not None:
                notes = [export_urdf(arm_found, place / urdf), export_mjcf(arm_found, place / mjcf)]
                console.note(dict.fromkeys(chain.from_iterable(notes)))
            torque_picture(place / "torque.png", context)
            identification_report(place / "report.html", context)
            write_json(place / "identification.json", content)
        models = (urdf, mjcf) if arm_found is not None else ()
        console.written(output, "identification.json", "report.html", "torque.png", *models)
