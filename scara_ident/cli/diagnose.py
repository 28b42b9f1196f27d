"""``scara-ident diagnose``."""

from __future__ import annotations

from typing import Annotated

import typer

from scara_ident.cli.console import (
    BandOption,
    JsonOption,
    ModelOption,
    OutputOption,
    RecordingArguments,
    RobotOption,
    VerboseOption,
    check_report,
    output_console,
    print_json,
    progress,
    show_recordings,
    table,
)


def _known(names: str | None) -> str | None:
    if names is not None:
        from scara_ident.effects import EFFECTS

        for name in _parted(names):
            EFFECTS.check(name)
    return names


def _parted(names: str) -> list[str]:
    return [name.strip() for name in names.split(",")]


def diagnose(
    recordings: RecordingArguments,
    robot: RobotOption = None,
    model: ModelOption = "complete",
    validate: Annotated[
        list[str] | None, typer.Option("--validate", metavar="RECORDING", help="Recording held out; may be repeated.")
    ] = None,
    band: BandOption = None,
    effects: Annotated[
        str | None,
        typer.Option(
            "--effects", metavar="NAME,...", callback=_known, help="Try only these effects; default: all there are."
        ),
    ] = None,
    output: OutputOption = None,
    json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find what the model lacks, trace it to a physical effect, add it, report before and after."""
    from scara_ident.diagnosis import diagnose as run
    from scara_ident.effects import effects_named
    from scara_ident.files import write_json, write_text, written_together
    from scara_ident.recording.recording import read_recordings
    from scara_ident.report.diagnosis import diagnosis_dict, diagnosis_markdown
    from scara_ident.robot.robot import load_robot

    check_report(output, "diagnosis")
    arm = load_robot(robot)
    with progress() as step:
        step("reading the recordings")
        training = read_recordings(recordings, arm)
        held_out = read_recordings(validate, arm) if validate else ()
        result = run(
            arm,
            model,
            training,
            held_out,
            bands=None if band is None else [band] * arm.n,
            catalogue=None if effects is None else effects_named(*_parted(effects)),
            progress=step,
        )
    content = diagnosis_dict(result)
    if json:
        print_json(content)
    console = output_console(quiet=json)
    if verbose:
        show_recordings(console, (*training, *held_out))
    for note in result.notes:
        console.print(f"note: {note}", markup=False, style="dim")
    console.print(f"{arm.name}: {result.verdict}", markup=False, style="bold")
    for sentence in content["summary"]:
        console.print(sentence, markup=False)
    errors = table("rms error within the band", "recordings", "joint", "before", "after", right=("before", "after"))
    for kind in ("training", "validation"):
        for joint in arm.joints if content[kind]["before"] else ():
            before, after = content[kind]["before"][joint], content[kind]["after"][joint]
            errors.add_row(kind, joint, _number(before), _number(after))
    console.print(errors)
    rows = table("candidates", "candidate", "gain", "p", "why", right=("gain", "p"))
    for row in content["candidates"] if verbose else content["candidates"][:8]:
        rows.add_row(row["label"], f"{row['gain']:.1%}", f"{row['p_value']:.0e}", row["why"])
    console.print(rows)
    if output is not None:
        from scara_ident.report.html import DiagnosisContext, diagnosis_report
        from scara_ident.report.pictures import diagnosis_pictures, remove_stale

        context = DiagnosisContext(result)
        with written_together(output) as place:
            pictures = diagnosis_pictures(place, context)
            write_text(place / "diagnosis.md", diagnosis_markdown(result, pictures))
            diagnosis_report(place / "report.html", context)
            write_json(place / "diagnosis.json", content)
        remove_stale(output, [name for _, name in pictures])
        names = ("diagnosis.json", "diagnosis.md", *(name for _, name in pictures), "report.html")
        written = ", ".join(str(output / name) for name in names)
        console.print(f"written: {written}", markup=False, soft_wrap=True)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
