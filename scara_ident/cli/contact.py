"""``scara-ident contact``."""

from __future__ import annotations

from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import READING_SHARE, check_report, progress, result_console, table, writing


def contact(
    recordings: options.Recordings,
    result: options.Result,
    free: Annotated[
        list[str],
        typer.Option(
            "--free", metavar="RECORDING", help="Recording without contact, which sets the thresholds; may be repeated."
        ),
    ],
    robot: options.RobotMoved = None,
    rate: Annotated[float, typer.Option(metavar="R", min=1e-6, help="Allowed false alarms per hour.")] = 1.0,
    bandwidth: Annotated[
        float,
        typer.Option(
            metavar="HZ", min=0.01, help="Bandwidth of the observer: a wider one detects sooner and is noisier."
        ),
    ] = 4.0,
    output: options.Output = None,
    json: options.Json = False,
) -> None:
    """Find contact with the arm in recordings: when, on which joints, and the force at the tool or the link."""
    from scara_ident.cli.reading import read_beside
    from scara_ident.export.result import read_identified
    from scara_ident.files import write_json
    from scara_ident.recording.shared_samples import shared_samples
    from scara_ident.use.contact import contacts_dict, look_for_contact
    from scara_ident.use.observer import contact_observer

    check_report(output, "contact")
    with progress() as work:
        work("reading the model and recordings")
        known = read_identified(result, robot, determined=True)
        arm = known.robot
        with read_beside(arm, free, recordings) as wanted:
            (quiet, notes), (watched, more) = wanted()
        more += [
            f"{other.path}: {share:.0%} of its samples are those of {first.path}, given as free of contact; a contact in it would "
            "raise the thresholds and may be missed"
            for other, first, share in shared_samples(quiet, watched)
        ]
        work("taking thresholds", READING_SHARE)
        observer = contact_observer(known, quiet, rate=rate, bandwidth=bandwidth)
        work("looking for contact", 0.5)
        found = look_for_contact(observer, watched)
    content = contacts_dict(found)
    console = result_console(content, json)
    console.note([*notes, *more])
    rows = table("contacts", "recording", "from", "to", "joints", "place", "force", right=("from", "to", "force"))
    for each in found.contacts:
        joints = ", ".join(each.joints)
        rows.add_row(each.recording, f"{each.start:.2f}", f"{each.stop:.2f}", joints, each.place, each.force_words)
    if found.contacts:
        console.print(rows)
    console.say(content["summary"])
    if output is not None:
        from scara_ident.report.drawing import draw
        from scara_ident.report.html.contact import contact_figures, contact_report

        with writing(output) as (place, work):
            work("drawing contact.png")
            draw(place / "contact.png", f"External torque on {arm.name}", contact_figures(found))
            work("drawing report.html", 0.7)
            contact_report(place / "report.html", found)
            write_json(place / "contacts.json", content)
        console.written(output, "contacts.json", "report.html", "contact.png")
