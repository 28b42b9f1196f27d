"""What is in the file of every kind of page."""

from __future__ import annotations

import re

import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.report.html.identification import IdentificationContext, identification_report
from scara_ident.report.html.page import FIRST_SAID, MAX_SENTENCES, Page, breakable, typeset
from tests.report.html.document import data_of, document
from tests.report.simulated import made, run

PAGES = (
    "identification", "diagnosis", "comparison", "excitation", "excitation in space", "paper", "check", "contact", "use",
    "fleet",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", PAGES)
def test_a_page_is_closed_html_that_loads_nothing(pages, kind):
    found = document(pages[kind])
    assert found.wrong == []
    assert found.open == []
    assert len(set(found.identities)) == len(found.identities)
    assert all(target.startswith("#") or target == "data:," for target in found.loads)
    text = pages[kind].read_text(encoding="utf-8")
    assert not re.search(r"https?://|url\((?!#)|@import|fetch\(|XMLHttpRequest|\bimport\(", text)


@pytest.mark.slow
@pytest.mark.parametrize("kind", PAGES)
def test_every_figure_of_a_page_has_its_data_and_every_data_its_figure(pages, kind):
    found = document(pages[kind])
    data = data_of(pages[kind])
    assert sorted(data["figures"]) == sorted(found.figures)
    assert len(found.figures) >= 2 or kind in ("paper", "contact")


def test_every_axis_of_a_figure_has_its_unit(pages):
    # Dates have no unit, and a share of one has none.
    for kind in set(PAGES) - {"fleet"}:
        data = data_of(pages[kind])
        for name, figure in data["figures"].items():
            for plot in figure["variants"].values():
                if plot.get("kind") == "matrix":
                    continue
                labels = [plot["x"]["label"], *(panel["label"] for panel in plot["panels"])]
                bare = [label for label in labels if "[" not in label]
                assert set(bare) <= {"samples", "correlation"}, (kind, name)


def test_a_name_cannot_break_out_of_the_page(tmp_path):
    nasty = run("</script><img src=x onerror=alert(1)>_1", 1)
    identification_report(tmp_path / "report.html", IdentificationContext(made([nasty])))
    found = document(tmp_path / "report.html")
    assert found.wrong == []
    assert "x" not in found.loads
    assert nasty.name in found.words


def test_a_report_that_cannot_be_written_leaves_nothing(tmp_path, result):
    blocked = tmp_path / "file"
    blocked.write_text("here")
    with pytest.raises(ScaraIdentError, match="cannot be written"):
        identification_report(blocked / "report.html", IdentificationContext(result))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_ten_recordings_of_25_s_stay_below_10_mb(big):
    assert big.stat().st_size <= 10e6


def test_a_number_stays_with_its_unit_and_percent_looks_the_same_everywhere():
    assert (
        typeset("5% of 3 N m/rad^2, 7.1 %")
        == "5\N{NO-BREAK SPACE}% of 3 N\N{NO-BREAK SPACE}m/rad², 7.1\N{NO-BREAK SPACE}%"
    )
    assert breakable("<a_b1.lower, 0.5") == "&lt;a_<wbr>b1.<wbr>lower, 0.5"


def test_of_a_long_verdict_the_first_sentences_are_shown_and_what_asks_something():
    said = ["Verdict.", *(f"Sentence {k}." for k in range(MAX_SENTENCES)), "Is the gain right?"]
    page = Page("", "", said, ())
    assert page.shown == [*said[1 : 1 + FIRST_SAID], "Is the gain right?"]
    assert sorted([*page.shown, *page.folded]) == sorted(said[1:])
    short = Page("", "", said[: MAX_SENTENCES + 1], ())
    assert (list(short.shown), list(short.folded)) == (said[1 : MAX_SENTENCES + 1], [])
