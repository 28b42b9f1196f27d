"""Effects found and effects tried, ranked, with the reason why each is in or out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scara_ident.report.html.page import Block, Cell, bar, chance, escape, folded, paragraph, table, tag

# Candidates shown at once, the best first; the others unfold.
SHOWN_CANDIDATES = 10


def candidate_blocks(content: dict[str, Any]) -> list[Block]:
    """Return the ranked table of the content of ``diagnosis.json``."""
    rows: list[list[Cell | str]] = []
    most = max((abs(row["gain"]) for row in (*content["effects"], *content["candidates"])), default=0.0) or 1.0
    for effect in content["effects"]:
        title = effect["effect"] if effect["joint"] is None else f"{effect['effect']} of {effect['joint']}"
        # On few rows the gain can come out a little above the whole.
        gain = min(1.0, effect["gain"])
        why = f"removes {gain:.1%} of the squared residual at that point on data that it was not fitted to"
        rows.append(_candidate(title, why, gain, effect["p_value"], effect["helps_in"], most, accepted=True))
    for row in content["candidates"]:
        good = row["decision"] == "accepted"
        rows.append(
            _candidate(row["label"], row["why"], row["gain"], row["p_value"], row["helps_in"], most, accepted=good)
        )
    head = ("candidate, and why", "gain", "p", "helps in", "decision")
    blocks: list[Block] = [
        paragraph(
            "First the effects found, in the order in which they came in; then what else was tried beside them, best member of every family. "
            "Gain: share of the squared residual removed on data not fitted to; p is corrected for all that was tried; helps in: trajectories, of those that excite it."
        ),
        table(head, rows[:SHOWN_CANDIDATES], numeric=(2,)),
    ]
    if len(rows) > SHOWN_CANDIDATES:
        rest = table(head, rows[SHOWN_CANDIDATES:], numeric=(2,))
        blocks.append(folded(f"{len(rows) - SHOWN_CANDIDATES} more candidates", rest))
    return blocks


def _candidate(
    title: str, why: str, gain: float, p_value: float, votes: Sequence[int], most: float, *, accepted: bool
) -> list[Cell | str]:
    return [
        Cell(f"<b>{escape(title)}</b><small>{escape(why)}</small>", "why"),
        Cell(f"{bar(gain / most)} {gain:.1%}", "unit"),
        chance(p_value),
        f"{votes[0]} of {votes[1]}",
        Cell(tag("found", "good") if accepted else tag("rejected")),
    ]
