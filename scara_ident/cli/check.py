"""``scara-ident check``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, table, writing


def check(
    trajectory: Annotated[
        Path, typer.Argument(metavar="TRAJECTORY", help="trajectory.csv, or a recording with or without effort.")
    ],
    result: options.Result,
    robot: options.RobotMoved = None,
    ranges: options.Ranges = None,
    velocities: options.Velocities = None,
    accelerations: options.Accelerations = None,
    torques: options.Torques = None,
    powers: Annotated[
        list[str] | None,
        typer.Option("--power", metavar="JOINT=P", help="Limit of the power that a drive gives or takes, W."),
    ] = None,
    output: options.Output = None,
    json: options.Json = False,
) -> None:
    """Say whether the arm can run a motion, which limit is nearest, and how much energy it takes; exit status 1 if it cannot."""
    from scara_ident.cli.joint_values import limits_by_joint
    from scara_ident.errors import ScaraIdentError
    from scara_ident.export.result import read_identified
    from scara_ident.files import write_json
    from scara_ident.recording.apart import read_apart
    from scara_ident.use.check import CLOSE_STDS, check_dict, read_motion
    from scara_ident.use.check import check as run
    from scara_ident.use.joint_limits import joint_limits

    check_report(output, "check")
    with progress() as work:
        work("reading the model")
        known = read_identified(result, robot, determined=True)
    arm = known.robot
    limits = joint_limits(
        arm,
        **limits_by_joint(ranges, velocities=velocities, accelerations=accelerations, torques=torques, powers=powers),
    )
    with progress() as work:
        work("reading the motion")
        motion = read_apart(lambda path: read_motion(path, known), trajectory)
        work("checking every limit", READING_SHARE)
        found = run(known, motion, limits)
    content = check_dict(found)
    console = result_console(content, json)
    spread = {f"{each.joint}.torque": CLOSE_STDS * each.std for each in found.peaks}
    rows = table("limits", "limit", "reached", "bound", "at [s]", "used", right=("reached", "bound", "at [s]", "used"))
    for each in found.margins:
        used = "-" if each.share is None else f"{each.share:.0%}"
        more = f" ± {spread[each.name]:.2g}" if each.name in spread else ""
        rows.add_row(each.name, f"{each.reached:.4g}{more}", f"{each.bound:.4g} {each.unit}", f"{each.time:.3f}", used)
    console.print(rows)
    energy = table("energy, J", "joint", "given", "taken back", "heat", right=("given", "taken back", "heat"))
    for joint, row in content["energy"].items():
        energy.add_row(joint, *(f"{row[key]:.4g}" for key in ("given", "returned", "heat")))
    console.print(energy)
    console.say(content["summary"])
    if output is not None:
        from scara_ident.report.drawing import draw
        from scara_ident.report.html.check import check_figures
        from scara_ident.report.html.check import check_report as write_report

        with writing(output) as (place, work):
            work("drawing check.png")
            draw(place / "check.png", f"Torque and power along {found.name}", check_figures(found))
            work("drawing report.html", 0.7)
            write_report(place / "report.html", found)
            write_json(place / "check.json", content)
        console.written(output, "check.json", "report.html", "check.png")
    if found.broken:
        # Two sentences as one line of an error.
        said = (f"{each[0].lower()}{each[1:].rstrip('.')}" for each in content["summary"][:2])
        raise ScaraIdentError(f"{trajectory}: {'; '.join(said)}")
