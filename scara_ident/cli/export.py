"""``scara-ident export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scara_ident.cli import options
from scara_ident.cli.console import progress, result_console, table


def export(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="identification.json or diagnosis.json.")],
    to: Annotated[
        Literal["urdf", "mjcf", "pinocchio", "c", "casadi", "ros2"],
        typer.Option(
            "--to",
            help="urdf; mjcf, with a Python callback for what MuJoCo lacks; pinocchio: a URDF and its loader; c: one "
            "header; casadi: a Python module; ros2: controllers' parameters.",
        ),
    ],
    robot: options.RobotMoved = None,
    output: options.Folder = Path("."),
    json: options.Json = False,
) -> None:
    """Write the identified arm for other programs, and report the held-out error of what was written."""
    from scara_ident.export.exported import export_model, said_lines, write_exported
    from scara_ident.export.result import read_identified
    from scara_ident.files import check_output

    check_output(output)
    with progress() as work:
        work("reading the model")
        found = read_identified(result, robot)
        work(f"writing {to}", 0.2)
        exported = export_model(found, to)
        work("predicting with what was written", 0.5)
        content = write_exported(found, exported, output, str(result))
    console = result_console(content, json)
    console.note(content["notes"])
    kinds = list(content["errors"])
    words = {"model": "model", "exported": "exported", "with_code": "with its code"}
    errors = table(
        f"rms error, {content['errors_of']} recordings", "joint", *(words[kind] for kind in kinds), "unit",
        right=tuple(words.values()),
    )  # fmt: skip
    for j, joint in enumerate(found.robot.joints):
        values = (content["errors"][kind][joint] for kind in kinds)
        errors.add_row(joint, *("-" if x is None else f"{x:.4g}" for x in values), found.robot.torque_unit(j))
    console.print(errors)
    for kind, said in zip(kinds[1:], (exported.alone, exported.beside), strict=False):
        for line in said_lines(words[kind], said) if said is not None else ():
            console.print(line)
    console.written(output, *content["files"], "export.json")
