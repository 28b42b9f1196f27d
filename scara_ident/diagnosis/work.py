"""Progress of a diagnosis: the share of the work that each step takes; no decision depends on it."""

from __future__ import annotations

from scara_ident.progress import Work

# Share of a search that making all candidates' columns takes.
_COLUMNS = 0.25
# Share of what is left of a search that each round takes: how many follow is not known.
_ROUND = 1.0 / 3.0
# Shares of a diagnosis before which its search begins, where the band is chosen, and after which it compares what it found.
_BAND, _SEARCHED = 0.12, 0.85
# Share of all searches that the first takes; further ones are rare, and each takes half of what is left.
_FIRST = 0.8


def searching(work: Work, *, band_given: bool) -> Work:
    """Return the part of a diagnosis that its searches take."""
    return work.part(0.0 if band_given else _BAND, _SEARCHED)


def first(work: Work) -> tuple[Work, Work]:
    """Return the part of the first search, and that of all others."""
    return work.part(0.0, _FIRST), work.part(_FIRST, 1.0)


def next_of(work: Work) -> tuple[Work, Work]:
    """Return the part of a further search, and what is left for others."""
    return work.part(0.0, 0.5), work.part(0.5, 1.0)


def after_rounds(rounds: int) -> float:
    """Return the share of a search that is done when its columns are made and so many rounds are over."""
    return 1.0 - (1.0 - _COLUMNS) * (1.0 - _ROUND) ** rounds
