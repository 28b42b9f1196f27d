"""``scara-ident diagnose``."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, show_recordings, writing


def _known(names: str | None) -> str | None:
    if names is not None:
        from scara_ident.effects import EFFECTS

        for name in _parted(names):
            EFFECTS.check(name)
    return names


def _parted(names: str) -> list[str]:
    return [name.strip() for name in names.split(",")]


def diagnose(
    recordings: options.Recordings,
    robot: options.Robot = None,
    model: options.Model = "complete",
    validate: options.Validate = None,
    band: options.Band = None,
    unloaded: Annotated[
        list[str] | None,
        typer.Option(
            "--unloaded",
            metavar="RECORDING",
            help="Recording known to be without payload; may be repeated. One to train on.",
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option(
            "--effects", metavar="NAME,...", callback=_known, help="Try only these effects; default: all there are."
        ),
    ] = None,
    output: options.Output = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Find what the model lacks, trace it to a physical effect, add it, report before and after."""
    from scara_ident.cli.startup import read_beside
    from scara_ident.robot.robot import load_robot

    check_report(output, "diagnosis")
    arm = load_robot(robot)
    with progress() as work:
        work("reading the recordings")
        with read_beside(arm, (*recordings, *(unloaded or ())), unloaded or (), validate or ()) as wanted:
            from scara_ident.diagnosis import diagnose as run
            from scara_ident.effects import effects_named
            from scara_ident.export.identified_model import identified_model
            from scara_ident.files import write_json, write_text
            from scara_ident.processes import beside
            from scara_ident.report.diagnosis import diagnosis_dict
            from scara_ident.report.diagnosis_markdown import diagnosis_markdown
            from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
            from scara_ident.report.html.page import page_template
            from scara_ident.report.told.diagnosis import tables
            from scara_ident.report.use import worth_dict

            if output is not None:
                _ = page_template()
            (training, useless), (bare, _), (held_out, more) = wanted()
        result = run(
            arm,
            training,
            model=model,
            validation=held_out,
            unloaded=[item.name for item in bare],
            bands=None if band is None else [band] * arm.n,
            catalogue=None if effects is None else effects_named(*_parted(effects)),
            progress=work.part(READING_SHARE, 1.0),
        )
        if output is not None:
            # What it holds is made once, for what is printed and for all files.
            context = DiagnosisContext(result)
            if result.effects:
                work("what the effects cost", 1.0)
                # The compiled arm takes a hundred megabytes, which go with its process; what draws is made ready meanwhile.
                with beside(lambda: worth_dict(identified_model(result))) as told:
                    import_module("matplotlib.figure")
                    context = DiagnosisContext(result, told)
                    context.make_ready()
                    _ = context.worth
    content = diagnosis_dict(result) if output is None else context.content
    console = result_console(content, json)
    if verbose:
        show_recordings(console, (*training, *held_out))
    console.note([*useless, *more, *result.notes])
    console.print(f"{arm.name}: {result.verdict}", style="bold")
    console.say(content["summary"])
    for each in tables(content, all_candidates=verbose):
        console.print(each)
    if output is not None:
        from scara_ident.report.pictures import diagnosis_pictures, remove_stale

        with writing(output) as (place, work):
            work("drawing pictures and report.html")
            pictures = diagnosis_pictures(place, context, lambda: diagnosis_report(place / "report.html", context))
            write_text(place / "diagnosis.md", diagnosis_markdown(result, pictures, content))
            write_json(place / "diagnosis.json", content)
        remove_stale(output, [name for _, name in pictures])
        console.written(output, "diagnosis.json", "diagnosis.md", *(name for _, name in pictures), "report.html")
