"""``scara-ident use``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import check_report, progress, result_console, table, writing


def use(
    result: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT", help="identification.json or diagnosis.json, as written by `identify` or `diagnose`."
        ),
    ],
    robot: options.RobotMoved = None,
    trajectory: Annotated[
        str | None,
        typer.Option(
            "--trajectory",
            metavar="FILE",
            help="Motion to follow, a trajectory.csv; default: a motion from pose to pose.",
        ),
    ] = None,
    recording: Annotated[
        list[str] | None,
        typer.Option(
            "--recording", metavar="RECORDING", help="Recording to compare a simulation with; may be repeated."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the motion and of the randomly drawn arms.")] = 0,
    output: options.Output = None,
    json: options.Json = False,
) -> None:
    """Say what the model gains: as feed-forward on virtual arms, and in simulation compared with recordings."""
    from scara_ident.cli.reading import read_beside
    from scara_ident.export.result import read_identified
    from scara_ident.files import write_json
    from scara_ident.report.html.use import use_report
    from scara_ident.report.use import WORDS, use_dict
    from scara_ident.simulation.named import named_motion
    from scara_ident.use import use as run

    check_report(output, "use")
    model = read_identified(result, robot)
    arm = model.robot
    motion = None if trajectory is None else named_motion(trajectory, arm)
    with progress() as work:
        with read_beside(arm, recording or ()) as wanted:
            ((given, useless),) = wanted()
        found = run(model, motion, given, seed=seed, progress=work)
    content = use_dict(found)
    console = result_console(content, json)
    console.note(useless)
    arms = tuple(WORDS[name] for name in content["tracking"])
    # A row a joint: seven joints side by side do not fit a line.
    rows = table("rms tracking error", "joint", *arms, "unit", right=arms)
    for joint in arm.joints:
        errors = (f"{of_arm[joint]:.3g}" for of_arm in content["tracking"].values())
        rows.add_row(joint, *errors, content["units"][joint])
    console.print(rows)
    console.say(content["summary"])
    if output is not None:
        with writing(output) as (place, _):
            use_report(place / "report.html", found)
            write_json(place / "use.json", content)
        console.written(output, "use.json", "report.html")
