"""How sure a diagnosis is: what is worth a look and not believed, and whether what is left was shown to be noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scara_ident.report.html.blocks import Block, Cell, Paragraph, Table, Tag, chance, name


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
        "Not believed and not in the model. The gain is the share of its joint's squared residual that it would remove on "
        "data that it was not fitted to."
    )
    head = ("effect", "gain", "p", "why it is not believed", "what would settle it")
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
            limit_words(item["detection_limit"]),
            Cell(item["why"], "words"),
        ]
        for joint, item in content["evidence"].items()
    ]
    words = (
        "That nothing was found says little where nothing could have been found. Of the effects tried on a joint, half would "
        "have had to remove at least the detection limit, a share of its squared residual, to come in. Torques are rms, "
        "in N m or, of a joint that slides, in N."
    )
    return [Paragraph(words), Table(("joint", "what is left", "detection limit", "why"), rows, (2,))]


def limit_words(limit: float | None) -> str:
    """Return a detection limit as a share; a dash where no effect was tried."""
    return "–" if limit is None else f"{limit:.1%}"
