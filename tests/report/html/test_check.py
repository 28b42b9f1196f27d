"""The report of a check."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.report.html.check import _heat_words, _worth, check_figures
from scara_ident.use.energy import Energy
from tests.report.html.document import data_of, document


def test_a_broken_limit_is_shown_with_its_time(checked, checked_page):
    page, data = document(checked_page), data_of(checked_page)
    assert (page.wrong, page.open) == ([], [])
    assert sorted(data["figures"]) == sorted(page.figures) == ["energy-time", "signals"]
    panels = data["figures"]["signals"]["variants"]["0"]["panels"]
    assert [panel["label"].split(" [")[0] for panel in panels] == ["position", "velocity", "acc.", "torque", "power"]
    torque = panels[3]["layers"]
    assert [layer["y"] for layer in torque if layer["t"] == "h"] == [-0.3, 0.3]
    assert [layer["x"] for layer in torque if layer["t"] == "v"] == [checked.limited_by.time]
    assert "It cannot be run: torque of joint1" in checked_page.read_text()
    assert [len(row) for row in check_figures(checked)] == [2, 2]
    assert "beyond it [s]" in page.words


@pytest.mark.parametrize(
    ("work", "said"),
    [
        ({}, "of these none becomes heat"),
        ({"Coulomb": 1.0}, "of these Coulomb becomes heat"),
        ({"Coulomb": 1.0, "viscous": 2.0}, "of these the sum of Coulomb, viscous becomes heat"),
        (
            {"viscous": 2.0, "cubic": -1.0},
            "of these the sum of viscous, cubic becomes heat; a negative one belongs to a friction curve, which only their sum describes",
        ),
    ],
)
def test_parts_of_friction_become_heat_together(work, said):
    """A cubic part that is negative takes no energy out: it bends the viscous one."""
    zero = np.zeros(1)
    energy = Energy(zero, zero, {key: np.array([value]) for key, value in work.items()}, tuple(work), zero)
    assert _heat_words(energy) == said


def test_rounding_is_no_work():
    assert _worth(5e-19, 75.0) == 0.0
    assert _worth(-0.3, 75.0) == -0.3
