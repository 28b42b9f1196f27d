"""The report of contacts: which, when, where, and the external torque over time beside its thresholds."""

from __future__ import annotations

from pathlib import Path

from scara_ident.manners import several
from scara_ident.report.html.blocks import Block, Cell, Group, Paragraph, Selector, Table, name, number
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection
from scara_ident.report.plot import Drawing, Figure, Layer, Panel, Plot, Region, single, thin_line
from scara_ident.use.contact import ContactFindings, sentences
from scara_ident.use.contact_force import MIN_JOINTS
from scara_ident.use.external_torque import Observed

# Points of a line and recordings drawn, at the most.
MAX_POINTS, MAX_RECORDINGS = 3000, 12


def contact_report(path: Path, found: ContactFindings) -> None:
    """Write the report of contacts as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    robot, alarm = found.observer.known.robot, found.observer.alarm
    sections = (
        NamedSection("contacts", "Contacts", _contacts),
        NamedSection("torque", "External torque", _torque),
        NamedSection("thresholds", "Thresholds", _thresholds),
    )
    subtitle = f"{several(len(found.observed), 'recording')}; thresholds for {alarm.rate:g} false alarm{'' if alarm.rate == 1.0 else 's'} an hour"
    page = Page(f"Contact with {robot.name}", subtitle, sentences(found), parts("contact", sections, found))
    page.write(path)


def contact_figures(found: ContactFindings) -> list[list[Figure]]:
    """Return what a still picture shows: the external torque in the recording with most contacts, a row per joint."""
    names = [each.recording for each in found.contacts]
    run = max(found.observed, key=lambda each: names.count(each.name))
    joints = found.observer.known.robot.joints
    return [
        [single("torque", f"{run.name}, {joint}", "", Plot("time [s]", (_panel(found, run, j, 120),)))]
        for j, joint in enumerate(joints)
    ]


def _contacts(found: ContactFindings) -> list[Block]:
    """What was found."""
    robot = found.observer.known.robot
    rows: list[list[Cell | str]] = []
    for each in found.contacts:
        first = robot.joints.index(each.joints[0])
        torque = f"{number(float(each.torque[first]))} {robot.torque_unit(first)}"
        spans = [f"{each.start:.2f}", f"{each.stop:.2f}"]
        rows.append(
            [
                name(each.recording),
                *spans,
                ", ".join(each.joints),
                torque,
                number(each.score),
                each.place,
                each.force_words,
                each.point_words,
            ]
        )
    loaded = f"{MIN_JOINTS} joints or more" if robot.n > MIN_JOINTS else "all joints"
    words = (
        "Torque is the mean on the first joint while the contact is strong, on the side where effort is recorded. The "
        f"place is the tool if a constant force at the tool explains the torque of {loaded}; otherwise it is the "
        f"outermost loaded link, and the contact is on that link or farther out."
    )
    if any(each.estimate.point is not None for each in found.contacts):
        words += " A force that does not act at the tool is given for the point of the link that is nearest to the tool and agrees with the torque, in the frame of the link."
    head = ("recording", "from [s]", "to [s]", "joints", "torque", "over threshold", "place", "force", "point [m]")
    return [Paragraph(words), Table(head, rows, (1, 2, 4, 5, 7, 8))] if rows else []


def _torque(found: ContactFindings) -> list[Block]:
    """The external torque of every joint over time."""
    robot, shown = found.observer.known.robot, found.observed[:MAX_RECORDINGS]
    variants: dict[tuple[int, ...], Drawing] = {
        (k,): Plot("time [s]", [_panel(found, run, j, 110) for j in range(robot.n)]) for k, run in enumerate(shown)
    }
    figure = Figure("external", "External torque, joint by joint", "", variants, (0,))
    selector = Selector("recording", tuple(run.name for run in shown))
    return [
        Paragraph(
            "Dashed: thresholds; they are larger near reversals, at high speed and when the momentum changes fast. Shaded: contacts."
        ),
        Group("external-group", (figure,), (selector,)),
    ]


def _panel(found: ContactFindings, run: Observed, j: int, height: int) -> Panel:
    robot = found.observer.known.robot
    threshold = found.observer.alarm.threshold(run.features)[j]
    layers: list[Layer] = [
        Region((each.start, each.stop), "vermillion", "contact", 0.2)
        for each in found.contacts
        if each.recording == run.name
    ]
    layers.append(thin_line(run.time, run.torque[j], MAX_POINTS, "blue", "external torque", 1.3))
    layers += [
        thin_line(run.time, sign * threshold, MAX_POINTS, "vermillion", "threshold", 1.3, "5 3") for sign in (-1.0, 1.0)
    ]
    return Panel(f"{robot.joints[j]} [{robot.torque_unit(j)}]", layers, height)


def _thresholds(found: ContactFindings) -> list[Block]:
    """What the thresholds are, in the usual states of a joint."""
    observer = found.observer
    robot, alarm = observer.known.robot, observer.alarm
    rows: list[list[Cell | str]] = [
        [name(joint), robot.torque_unit(j), *(number(max(value, alarm.floor[j])) for value in alarm.scale[j, :5])]
        for j, joint in enumerate(robot.joints)
    ]
    head = ("joint", "unit", "fast, backwards", "slow, backwards", "at rest", "slow, forwards", "fast, forwards")
    words = (
        f"Thresholds by speed and direction, without the parts for the rate of momentum and the effort. They come from "
        f"{alarm.clusters} peaks of the residual in {3600.0 * alarm.hours:.4g} s without contact."
    )
    return [Paragraph(words), Table(head, rows, (2, 3, 4, 5, 6))]
