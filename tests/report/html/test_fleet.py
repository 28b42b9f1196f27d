"""The page of a fleet."""

from __future__ import annotations

import numpy as np

from tests.report.html.document import data_of, document
from tests.report.html.made_fleet import made_fleet


def test_the_arm_that_changed_comes_first_with_what_and_since_when(fleet_page):
    page = document(fleet_page)
    assert page.wrong == []
    assert page.sections == ["arms", "time", "quantities", "faults"]
    assert "1 of 3 arms changed by more than noise." in page.words
    assert "arm2: Coulomb friction of joint2 up 31 % (± 2 %) since 15 February 2026." in page.words
    assert page.words.index("arm2") < page.words.index("arm1")
    assert "arm2/x.csv: <not> whole" in page.words


def test_every_quantity_is_drawn_with_its_bars_for_every_arm(fleet_page):
    fleet = made_fleet()
    figures = data_of(fleet_page)["figures"]
    plots = [plot for figure in figures.values() for plot in figure["variants"].values()]
    told = [{one.name for each in dates for one in each if np.isfinite(one.std)} for dates in fleet.quantities.values()]
    assert len(plots) == sum(map(len, told))
    assert all(any("e" in layer for layer in plot["panels"][0]["layers"]) for plot in plots)
    # The quantity that changed is the first of its joint.
    changed = figures["time-0"]["variants"]["0,1"]["panels"][0]
    assert changed["label"].startswith("a02")
    assert {layer.get("c") for layer in changed["layers"]} == {"grey", "blue", "vermillion"}
