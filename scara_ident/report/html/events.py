"""What was local in time in the recordings: which, when, on which joints, how large, and what it looks like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.identification.events import Event
from scara_ident.report.html.blocks import Block, Cell, Paragraph, Table, name, number
from scara_ident.robot.robot import Robot


def events_blocks(robot: Robot, events: Sequence[Event]) -> Sequence[Block]:
    """Return a table of events; nothing without.

    Parameters
    ----------
    robot : Robot
    events : sequence of Event
    """
    rows: list[list[Cell | str]] = [
        [
            name(event.recording),
            f"{event.start:.2f}",
            f"{event.stop:.2f}",
            ", ".join(event.joints),
            f"{number(event.rms)} {robot.torque_unit(robot.joints.index(event.joints[0]))}",
            event.kind,
            "–" if event.force is None else f"{np.linalg.norm(event.force):.3g} N",
            "held out" if event.held_out else "left out of the fit",
        ]
        for event in events
    ]
    words = (
        "Stretches, or whole recordings, that are not explained while others are: no parameter, but something that happened. "
        "Times are seconds since the recording began; the size is the rms on the first joint, the force what a constant one at "
        "the tool would have to be."
    )
    head = ("recording", "from [s]", "to [s]", "joints", "rms", "kind", "force", "")
    return [Paragraph(words), Table(head, rows, (1, 2, 4, 6))] if rows else []
