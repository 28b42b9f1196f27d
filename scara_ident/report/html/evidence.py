"""The evidence behind a result, section by section: errors before and after, what was tried, what is uncertain, events, how runs differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scara_ident.estimation.run_variation import KINDS, RunVariation, unit_of_kind
from scara_ident.identification.events import Event
from scara_ident.report.html.blocks import Block, Cell, Folded, Paragraph, Table, Tag, chance, name, number
from scara_ident.report.left_out import left_out_words
from scara_ident.robot.robot import Robot

RECORDINGS = (("validation", "held out"), ("training", "training"))
# Candidates shown at once, the best first; the others unfold.
SHOWN_CANDIDATES = 10
CANDIDATE_HEAD = ("candidate, and why", "gain", "p", "helps in", "decision")


def gain_blocks(content: Mapping[str, Any], robot: Robot) -> list[Block]:
    """Return the errors by joint before and after, and unfolded by recording; one error where nothing came in.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    """
    times = ("before", "after") if content["effects"] else ("before",)
    rows: list[list[Cell | str]] = []
    for kind, words in RECORDINGS:
        part = content[kind]
        for own in ("", "_own_offset"):
            for j, joint in enumerate(robot.joints) if part.get(f"before{own}") else ():
                values = [part[f"{when}{own}"][joint] for when in times]
                left = [_left(*values)] if len(times) > 1 else []
                shares = ["" if own else share_words(part[f"{when}_relative"][joint]) for when in times]
                cells: list[Cell | str] = [*map(number, values), *left, *shares]
                cells.append(number(content["noise_floor"].get(joint)))
                rows.append([f"{words}, own offsets" if own else words, name(joint), *cells, robot.torque_unit(j)])
    found = ["before", "after", "what is left", "before, of torque", "after, of torque"]
    head = ["recordings", "joint", *(found if len(times) > 1 else ["error", "of torque"]), "noise floor", "unit"]
    numeric = [k for k in range(2, len(head) - 1) if head[k] != "what is left"]
    detail: list[list[Cell | str]] = [
        [name(recording), Cell(words, "unit"), *(number(row[when][joint]) for joint in robot.joints for when in times)]
        for kind, words in RECORDINGS
        for recording, row in content["recordings"][kind].items()
    ]
    columns = [
        f"{joint}{f' {when}' if len(times) > 1 else ''} [{robot.torque_unit(j)}]"
        for j, joint in enumerate(robot.joints)
        for when in times
    ]
    said = f"Rms residual within the band. {left_out_words(content)} No choice used the held-out recordings; the noise floor is what does not repeat."
    if any("after_own_offset" in content[kind] for kind, _ in RECORDINGS):
        said += " The torque offsets differ from recording to recording; own offsets: the error after each recording's own offset is removed."
    return [
        Paragraph(
            said if len(times) > 1 else f"{said} No effect was added to the model: before and after are the same."
        ),
        Table(head, rows, numeric),
        Folded("every recording", Table(("recording", "", *columns), detail, range(2, 2 + len(columns)))),
    ]


def _left(before: float | None, after: float | None) -> Cell:
    if not before or after is None:
        return Cell()
    return Cell(f"{after / before:.0%}", "unit", track=after / before)


def candidate_blocks(content: dict[str, Any]) -> list[Block]:
    """Return the ranked table of the content of ``diagnosis.json``."""
    most = max((abs(row["gain"]) for row in (*content["effects"], *content["candidates"])), default=0.0) or 1.0
    rows: list[list[Cell | str]] = []
    for effect in content["effects"]:
        title = effect["effect"] if effect["joint"] is None else f"{effect['effect']} of {effect['joint']}"
        why = f"at that step it removes {effect['gain']:.1%} of the squared residual in cross-validation"
        rows.append(_candidate({**effect, "label": title, "why": why, "decision": "accepted"}, most))
    rows += [_candidate(row, most) for row in content["candidates"]]
    words = (
        "First the effects found, in the order in which they were added; then the other candidates, with the effects "
        "found in the model: the best member of each family. Gain: share of the squared residual removed in "
        "cross-validation; p is corrected for the number of candidates; helps in: number of trajectories, of those "
        "that excite it."
    )
    blocks: list[Block] = [Paragraph(words), Table(CANDIDATE_HEAD, rows[:SHOWN_CANDIDATES], (2,))]
    more = rows[SHOWN_CANDIDATES:]
    return [*blocks, Folded(f"{len(more)} more candidates", Table(CANDIDATE_HEAD, more, (2,)))] if more else blocks


def _candidate(row: Mapping[str, Any], most: float) -> list[Cell | str]:
    helps, voting = row["helps_in"]
    return [
        Cell(kind="why", title=row["label"], note=row["why"]),
        # No minus before a gain that rounds to nothing.
        Cell(f"{row['gain']:z.1%}", "unit", bar=row["gain"] / most),
        chance(row["p_value"]),
        f"{helps} of {voting}",
        Cell(tag=Tag("found", "good") if row["decision"] == "accepted" else Tag("rejected")),
    ]


def tentative_blocks(content: Mapping[str, Any]) -> Sequence[Block]:
    """Return the effects that are worth a look, with what would settle them; nothing without.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    """
    rows: list[list[Cell | str]] = [
        [
            name(item["effect"] if item["joint"] is None else f"{item['effect']} on {item['joint']}"),
            f"{item['gain']:.1%}",
            chance(item["p_value"]),
            Cell(item["why"], "words"),
            Cell(item["settled_by"], "words"),
        ]
        for item in content["tentative"]
    ]
    words = (
        "Not believed and not in the model. The gain is the share of its joint's squared residual that it would remove "
        "in cross-validation."
    )
    head = ("effect", "gain", "p over all tried", "why it is not believed", "what would settle it")
    return [Paragraph(words), Table(head, rows, (1, 2))] if rows else []


def evidence_blocks(content: Mapping[str, Any]) -> Sequence[Block]:
    """Return for each joint whether what is left was shown to be noise, by what, and what would not have been seen.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    """
    rows: list[list[Cell | str]] = [
        [
            name(joint),
            Cell(tag=Tag(f"noise, by {item['by']}", "good") if item["noise"] else Tag("not shown", "bad")),
            share_words(item["detection_limit"]),
            Cell(item["why"], "words"),
        ]
        for joint, item in content["evidence"].items()
    ]
    words = (
        "Finding no effect means little if none could have been found. Half of the effects tried on a joint would have "
        "had to remove at least the detection limit, a share of its squared residual, to be accepted. Torques are "
        "rms."
    )
    return [Paragraph(words), Table(("joint", "what is left", "detection limit", "why"), rows, (2,))]


def events_blocks(robot: Robot, events: Sequence[Event]) -> Sequence[Block]:
    """Return a table of events; nothing without."""
    rows: list[list[Cell | str]] = [
        [
            name(event.recording),
            f"{event.start:.2f}",
            f"{event.stop:.2f}",
            ", ".join([*(joint for joint, _ in event.sized), *event.joints[len(event.sized) :]]),
            ", ".join(f"{number(size)} {robot.torque_unit(robot.joints.index(joint))}" for joint, size in event.sized),
            event.kind,
            "–" if event.force is None else f"{np.linalg.norm(event.force):.3g} N",
            "held out" if event.held_out else "left out of the fit",
        ]
        for event in events
    ]
    words = (
        "Stretches of time, or whole recordings, that the model does not explain although it explains the others: no "
        "parameter, but something that happened. Times are in seconds from the start of the recording; the size is "
        "the rms on each joint; the force is the constant force at the tool that would explain it."
    )
    head = ("recording", "from [s]", "to [s]", "joints", "rms", "kind", "force", "")
    return [Paragraph(words), Table(head, rows, (1, 2, 4, 6))] if rows else []


def variation_blocks(robot: Robot, variation: RunVariation | None, runs: Sequence[str]) -> Sequence[Block]:
    """Return how much runs differ on each joint, and by how much each run lies off; nothing where they do not.

    Parameters
    ----------
    runs : sequence of str
        Names of the recordings fitted, in their order.
    """
    if not variation:
        return []
    rows: list[list[Cell | str]] = [
        [name(joint), Cell(kind, "unit"), *_sized(std, unit_of_kind(robot, joint, kind))]
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
        found = [_sized(float(off), unit_of_kind(robot, joint, KINDS[k])) for off in item.of_run[:, k]]
        each.append([name(joint), Cell(variation.kinds[k], "unit"), *(value for value, _ in found), found[0][1]])
    head = ["joint", "what differs", *runs, "unit"]
    words = (
        "Standard deviation between runs, in addition to noise; it is included in the standard deviations of all "
        "parameters. Friction and torque scale are shares of the predicted torque. Kinds that chance explains are "
        "left out."
    )
    return [
        Paragraph(words),
        Table(("joint", "what differs", "std between runs", "unit"), rows, (2,)),
        Folded("every recording", Table(head, each, range(2, len(head) - 1))),
    ]


def _sized(size: float, unit: str) -> tuple[str, str]:
    """Return a size and its unit; shares are said in percent."""
    return (number(100.0 * size), "%") if unit == "1" else (number(size), unit)


def share_words(value: float | None) -> str:
    """Return a share in percent; a dash where there is none."""
    return "–" if value is None else f"{value:.1%}"
