"""What the effects found win: the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scara_ident.report.html.blocks import Block, Cell, Folded, Paragraph, Table, name, number
from scara_ident.robot.robot import Robot

KINDS = (("validation", "held out"), ("training", "training"))


def gain_blocks(content: Mapping[str, Any], robot: Robot) -> list[Block]:
    """Return the errors by joint before and after, and unfolded by recording; one error where nothing came in.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    robot : Robot
    """
    times = ("before", "after") if content["effects"] else ("before",)
    rows: list[list[Cell | str]] = []
    for kind, words in KINDS:
        part = content[kind]
        for j, joint in enumerate(robot.joints) if part["before"] else ():
            values = [part[when][joint] for when in times]
            left = [_left(*values)] if len(times) > 1 else []
            shares = [_share(part[f"{when}_relative"][joint]) for when in times]
            floor = number(content["noise_floor"].get(joint))
            rows.append([words, name(joint), *map(number, values), *left, *shares, floor, robot.torque_unit(j)])
    found = ["before", "after", "what is left", "before, of torque", "after, of torque"]
    head = ["recordings", "joint", *(found if len(times) > 1 else ["error", "of torque"]), "noise floor", "unit"]
    numeric = [k for k in range(2, len(head) - 1) if head[k] != "what is left"]
    detail: list[list[Cell | str]] = [
        [name(recording), Cell(words, "unit"), *(number(row[when][joint]) for joint in robot.joints for when in times)]
        for kind, words in KINDS
        for recording, row in content["recordings"][kind].items()
    ]
    columns = [
        f"{joint}{f' {when}' if len(times) > 1 else ''} [{robot.torque_unit(j)}]"
        for j, joint in enumerate(robot.joints)
        for when in times
    ]
    said = "Rms residual within the band. Held-out recordings took no part in any choice; the noise floor is what does not repeat."
    return [
        Paragraph(said if len(times) > 1 else f"{said} Nothing came into the model: before and after are the same."),
        Table(head, rows, numeric),
        Folded("every recording", Table(("recording", "", *columns), detail, range(2, 2 + len(columns)))),
    ]


def _left(before: float | None, after: float | None) -> Cell:
    if not before or after is None:
        return Cell()
    return Cell(f"{after / before:.0%}", "unit", track=after / before)


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"
