"""Effects found and effects tried, ranked, with the reason why each is in or out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scara_ident.report.html.blocks import Block, Cell, Folded, Paragraph, Table, Tag, chance

# Candidates shown at once, the best first; the others unfold.
SHOWN_CANDIDATES = 10
HEAD = ("candidate, and why", "gain", "p", "helps in", "decision")


def candidate_blocks(content: dict[str, Any]) -> list[Block]:
    """Return the ranked table of the content of ``diagnosis.json``."""
    most = max((abs(row["gain"]) for row in (*content["effects"], *content["candidates"])), default=0.0) or 1.0
    rows: list[list[Cell | str]] = []
    for effect in content["effects"]:
        title = effect["effect"] if effect["joint"] is None else f"{effect['effect']} of {effect['joint']}"
        why = f"removes {effect['gain']:.1%} of the squared residual at that point on data that it was not fitted to"
        rows.append(_candidate({**effect, "label": title, "why": why, "decision": "accepted"}, most))
    rows += [_candidate(row, most) for row in content["candidates"]]
    words = (
        "First the effects found, in the order in which they came in; then what else was tried beside them, best member of every family. "
        "Gain: share of the squared residual removed on data not fitted to; p is corrected for all that was tried; helps in: trajectories, of those that excite it."
    )
    blocks: list[Block] = [Paragraph(words), Table(HEAD, rows[:SHOWN_CANDIDATES], (2,))]
    more = rows[SHOWN_CANDIDATES:]
    return [*blocks, Folded(f"{len(more)} more candidates", Table(HEAD, more, (2,)))] if more else blocks


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
