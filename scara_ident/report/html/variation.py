"""How runs differ from one another, which is in every standard deviation."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.estimation.run_variation import KINDS, RunVariation, unit_of_kind
from scara_ident.report.html.blocks import Block, Cell, Folded, Paragraph, Table, name, number
from scara_ident.robot.robot import Robot


def variation_blocks(robot: Robot, variation: RunVariation | None, runs: Sequence[str]) -> Sequence[Block]:
    """Return how much runs differ on each joint, and by how much each run lies off; nothing where they do not.

    Parameters
    ----------
    robot : Robot
    variation : RunVariation or None
    runs : sequence of str
        Names of the recordings fitted, in their order.
    """
    if not variation:
        return []
    rows: list[list[Cell | str]] = [
        [name(joint), Cell(kind, "unit"), *_said(std, unit_of_kind(robot, joint, kind))]
        for joint, kinds in variation.sizes(robot).items()
        for kind, std in kinds.items()
    ]
    shown = [
        (joint, k, item)
        for joint, item in zip(robot.joints, variation.joints, strict=True)
        if item is not None
        for k in range(len(KINDS))
        if item.std[k] > 0.0
    ]
    each: list[list[Cell | str]] = []
    for joint, k, item in shown:
        found = [_said(float(off), unit_of_kind(robot, joint, KINDS[k])) for off in item.of_run[:, k]]
        each.append([name(joint), Cell(KINDS[k], "unit"), *(value for value, _ in found), found[0][1]])
    head = ["joint", "what differs", *runs, "unit"]
    words = (
        "Standard deviation between runs, beyond what noise makes of them; it is in the standard deviations of all parameters. "
        "Friction and torque scale are shares of what the model predicts. Kinds that chance explains are left out."
    )
    return [
        Paragraph(words),
        Table(("joint", "what differs", "std between runs", "unit"), rows, (2,)),
        Folded("every recording", Table(head, each, range(2, len(head) - 1))),
    ]


def _said(size: float, unit: str) -> tuple[str, str]:
    """Return a size and its unit; shares are said in percent."""
    return (number(100.0 * size), "%") if unit == "1" else (number(size), unit)
