"""``scara-ident inspect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scara_ident.cli import options
from scara_ident.cli.console import PlainConsole, output_console, print_json, progress, table

if TYPE_CHECKING:
    from scara_ident.inspection.inspection import Inspection

# Of columns that are no channels so many are shown on a terminal; --json has them all.
OTHERS_SHOWN = 20
# Longer names go on in the next line, and so do names that would leave no room for a word of what they are taken for.
LONGEST_NAME = 40
# What a table puts between two columns, and how many there are before the last one.
GAP, BEFORE = 2, 3


def inspect(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="A recording: .parquet, .csv, .mat, .npz, .h5, .mcap, .db3, or a rosbag2 folder."
        ),
    ],
    urdf: Annotated[
        Path | None,
        typer.Option(
            "--urdf", metavar="URDF", help="URDF of the arm, or a name such as ur5; columns are matched to its joints."
        ),
    ] = None,
    robot: Annotated[
        Path | None,
        typer.Option("--robot", metavar="FILE", help="robot.yaml whose column mapping is checked on this file."),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(
            "--joints", metavar="PATTERN", help="Joints of the URDF to identify: a regular expression such as 'arm_.*'."
        ),
    ] = None,
    output: options.Output = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Show what is in a file, guess which columns belong to the arm, audit the data and write a first robot.yaml."""
    from scara_ident.errors import ScaraIdentError, UsageError
    from scara_ident.files import check_output, write_text
    from scara_ident.inspection.inspection import inspect_file
    from scara_ident.recording.apart import read_apart

    target = None if output is None else output / "robot.yaml"
    if target is not None and urdf is None:
        raise UsageError("--output: a first robot.yaml is made from a URDF; give --urdf")
    if target is not None and (target.exists() or target.is_symlink()):
        raise ScaraIdentError(f"{target}: exists already and is not overwritten; move it away or give another --output")
    check_output(output)
    with progress() as work:
        work("reading the file")
        found = read_apart(
            lambda path: inspect_file(path, urdf=urdf, robot=robot, joints=joints, folder=output or "."), file
        )
    if target is not None and found.description is not None:
        write_text(target, found.description)
    if json:
        print_json(inspection_dict(found, target))
    else:
        _show(output_console(), found, target)
    if robot is not None and found.recording is None:
        raise ScaraIdentError(found.refusal or f"{file}: {'; '.join(found.problems)}")


def inspection_dict(found: Inspection, written: Path | None) -> dict[str, Any]:
    """Return an inspection as JSON has it."""
    recording = found.recording
    audit = None
    if recording is not None:
        audit = {
            "samples": len(recording.time),
            "duration": recording.time[-1] - recording.time[0],
            "rate": recording.rate,
            "findings": [{"kind": f.kind, "message": f.message, "count": f.count} for f in recording.findings],
        }
    return {
        "file": str(found.path),
        "topics": dict(found.topics),
        "topic": found.topic,
        "columns": [vars(column) for column in found.columns],
        "recording": dict(found.mapping),
        "notes": list(found.notes),
        "problems": list(found.problems),
        "audit": audit,
        "refusal": found.refusal,
        "robot_yaml": found.description,
        "written": None if written is None else str(written),
    }


def _show(console: PlainConsole, found: Inspection, written: Path | None) -> None:
    from scara_ident.manners import several

    rows = table(str(found.path), "column", "samples", "range", "taken for", right=("samples",))
    lines, others = [], 0
    for column in found.columns:
        others += not column.channel
        if not column.channel and others > OTHERS_SHOWN:
            continue
        span = "" if column.low is None or column.high is None else f"{column.low:.4g} .. {column.high:.4g}"
        samples = f"{column.samples}" + (f" (-{column.missing})" if column.missing else "")
        said = [_meaning(column)] + ([] if column.kind == "numbers" else [column.kind])
        lines.append((column.name, samples, span, "; ".join(filter(None, said))))
    # Only the last column folds, so that names can be copied into robot.yaml.
    longest = [max(map(len, texts), default=0) for texts in zip(*lines, strict=True)] or [0] * (BEFORE + 1)
    word = max((len(each) for line in lines for each in line[BEFORE].split()), default=0)
    whole = longest[0] <= LONGEST_NAME and word <= console.width - sum(longest[:BEFORE]) - BEFORE * GAP
    for place, keep in enumerate((whole, True, True)):
        rows.columns[place].no_wrap = keep
    for line in lines:
        rows.add_row(*line)
    console.print(rows)
    if others > OTHERS_SHOWN:
        console.print(f"... and {others - OTHERS_SHOWN} other columns; --json lists them")
    if len(found.topics) > 1:
        listed = ", ".join(f"{topic} ({count})" for topic, count in found.topics.items())
        console.print(f"topics of joint states: {listed}")
    console.note(found.notes)
    for problem in found.problems:
        console.print(f"missing: {problem}")
    recording = found.recording
    if recording is not None:
        seconds = recording.time[-1] - recording.time[0]
        console.print(
            f"audit: {len(recording.time)} samples, {seconds:.4g} s, {recording.rate:.4g} Hz; "
            f"{several(len(recording.findings), 'finding')}"
        )
        for finding in recording.findings:
            console.print(f"  {finding.message}")
    elif found.refusal is not None:
        console.print(f"audit: refused: {found.refusal}")
    if written is not None:
        console.print(f"written: {written}; go through the lines marked STATE", soft_wrap=True)
    elif found.description is not None:
        console.print("give --output DIR to write a first robot.yaml")
    elif recording is None and found.refusal is None:
        console.print("give --urdf URDF to match the columns to the arm's joints and to audit them")


def _meaning(column: Any) -> str:
    if column.quantity is None:
        return ""
    # A name that begins with the joint's need not say it again.
    named = column.joint is None or column.name.startswith(f"{column.joint}.")
    text = column.quantity if named else f"{column.quantity} of {column.joint}"
    text += f", {column.unit}" if column.unit else ""
    return text if column.channel else f"({text})"
