"""``scara-ident diagnose``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, show_recordings, writing

if TYPE_CHECKING:
    from scara_ident.diagnosis import Diagnosis
    from scara_ident.report.html.diagnosis import DiagnosisContext
    from scara_ident.report.pictures import Picture


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
            help="Recording that is known to be without payload; the model is fitted to it too; may be repeated.",
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option(
            "--effects", metavar="NAME,...", callback=_known, help="Try only these effects; default: all effects."
        ),
    ] = None,
    output: options.Output = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Find what the model lacks, trace it to a physical effect, add the effect, and report the error before and after."""
    from scara_ident.cli.reading import read_beside
    from scara_ident.robot.robot import load_robot

    check_report(output, "diagnosis")
    arm = load_robot(robot)
    with ExitStack() as others:
        with progress() as work:
            work("reading the recordings")
            with read_beside(arm, (*recordings, *(unloaded or ())), unloaded or (), validate or ()) as wanted:
                from scara_ident.diagnosis import diagnose as run
                from scara_ident.effects import effects_named
                from scara_ident.files import write_json, write_text
                from scara_ident.report.diagnosis import diagnosis_dict
                from scara_ident.report.diagnosis_markdown import diagnosis_markdown
                from scara_ident.report.doubts import parted
                from scara_ident.report.html.diagnosis import diagnosis_report
                from scara_ident.report.html.page import page_template
                from scara_ident.report.pictures import remove_stale
                from scara_ident.report.summaries.diagnosis import tables

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
                work("what the effects cost", 1.0)
                context, drawn = others.enter_context(_drawn_meanwhile(result))
                _ = context.content
        content = diagnosis_dict(result) if output is None else context.content
        console = result_console(content, json)
        if verbose:
            show_recordings(console, (*training, *held_out))
        first, rest = parted(content)
        console.say(first)
        console.note([*useless, *more, *result.notes])
        console.print(f"{arm.name}: {result.verdict}", style="bold")
        console.say(rest)
        for each in tables(content, all_candidates=verbose):
            console.print(each)
        if output is not None:
            with writing(output) as (place, work):
                work("drawing report.html and pictures")
                diagnosis_report(place / "report.html", context)
                pictures = drawn()
                for picture in pictures:
                    (place / picture.name).write_bytes(picture.content)
                names = [(picture.title, picture.name) for picture in pictures]
                write_text(place / "diagnosis.md", diagnosis_markdown(result, names, content))
                write_json(place / "diagnosis.json", content)
            remove_stale(output, [name for _, name in names])
            console.written(output, "diagnosis.json", "diagnosis.md", *(name for _, name in names), "report.html")


@contextmanager
def _drawn_meanwhile(result: Diagnosis) -> Iterator[tuple[DiagnosisContext, Callable[[], tuple[Picture, ...]]]]:
    """Compute what the effects cost, and draw the pictures, in processes that run at the same time.

    Yields the context, which everything printed and written shares, and a function that waits for the pictures.
    """
    from scara_ident.export.identified_model import identified_model
    from scara_ident.processes import beside
    from scara_ident.report.html.diagnosis import DiagnosisContext
    from scara_ident.report.pictures import diagnosis_pictures
    from scara_ident.report.use import worth_dict

    context = DiagnosisContext(result)
    if not result.effects and result.unexplained is None:
        yield context, tuple
        return
    with ExitStack() as others:
        if result.effects:
            # The compiled arm takes a hundred megabytes, and what draws takes some, which go with their processes.
            worth = others.enter_context(beside(lambda: worth_dict(identified_model(result))))
            context = DiagnosisContext(result, worth)
        context.make_ready()
        yield context, others.enter_context(beside(lambda: diagnosis_pictures(context)))
