"""The gallery of effects says what the effects' classes say, and shows each."""

from __future__ import annotations

import pytest

from docs import gallery
from scara_ident import diagnose
from scara_ident.effects import CATALOGUE
from tests.docs.pages import not_printed
from tests.shared import ROOT

FIGURES = ROOT / "docs" / "figures"
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


def test_the_page_is_what_the_classes_say_today():
    assert gallery.page(gallery.computed_in(PAGE)) == PAGE, "run: python docs/gallery.py --words"


def test_every_effect_has_its_section_its_picture_and_what_it_is_taken_for():
    computed = gallery.computed_in(PAGE)
    assert set(computed) == {effect.name for effect in CATALOGUE}
    for effect in CATALOGUE:
        assert f"figures/effects/{effect.name}.png" in PAGE
        assert effect.experiment in PAGE
        assert "Found: " in computed[effect.name] and "**Taken for:** " in computed[effect.name]
    assert {path.stem for path in (FIGURES / "effects").glob("*.png")} == set(computed)


def test_a_word_that_a_class_changes_makes_the_page_stale(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(type(CATALOGUE[0]), "experiment", "something else")
    assert gallery.page(gallery.computed_in(PAGE)) != PAGE


def test_the_pictures_are_small():
    assert sum(path.stat().st_size for path in (FIGURES / "effects").glob("*")) < 600_000
    assert (FIGURES / "report.png").stat().st_size < 250_000
    assert sum(path.stat().st_size for path in FIGURES.rglob("*.*")) < 1_500_000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stribeck", "transmission_loss", "payload_change"])
def test_what_the_page_says_was_found_is_what_the_program_finds_today(name: str):
    robot, runs, hidden = gallery.recordings(name)
    effect = next(found for found in diagnose(robot, runs).effects if found.effect == name)
    told = gallery.computed_of(name, robot, runs, hidden, effect)
    shown = gallery.computed_in(PAGE)[name]
    assert not_printed(shown.splitlines(), told) is None, f"run: python docs/gallery.py; found now:\n{told}"
