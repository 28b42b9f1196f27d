"""Whether the loop is compiled first, and who is told."""

from __future__ import annotations

from scara_ident.simulation import first_run, loop
from scara_ident.simulation.first_run import COMPILING, compiled_first
from tests.results import Results


def test_compiling_is_named_and_what_follows_has_the_rest_of_the_bar(results: Results, monkeypatch):
    told: list[tuple[str, float]] = []
    monkeypatch.setattr(loop, "at_once", lambda: False)
    compiled_first(results.arm, lambda *each: told.append(each))("simulating", 0.5)
    assert told == [(COMPILING, 0.0), ("simulating", first_run.SHARE + 0.5 * (1.0 - first_run.SHARE))]


def test_where_it_was_compiled_nothing_is_said(results: Results):
    told: list[tuple[str, float]] = []
    assert loop.at_once()
    compiled_first(results.arm, lambda *each: told.append(each))("simulating", 0.5)
    assert told == [("simulating", 0.5)]
    # One signature: what was compiled first is what every run uses.
    assert len(loop._track.signatures) == 1
