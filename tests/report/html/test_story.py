"""The figures that show one effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import View
from scara_ident.report.html.chapters import Chapter
from scara_ident.report.html.story import SIGNALS, chapter_group
from scara_ident.robot.robot import load_robot
from tests.report.simulated import swinging, trace_of

BANDS = (15.0, 15.0)


def test_after_a_reversal_the_distance_over_which_the_effect_acts_is_shown():
    residual = np.random.default_rng(0).standard_normal((2, 20000))
    trace = trace_of(swinging(residual))
    for distance in (0.02, 1e-6):
        view = View("reversal", along=True)
        chapter = Chapter(1, "presliding", 0, [trace], [trace], BANDS, "joint1", view, distance=distance)
        plot = chapter_group(load_robot(), chapter).figures[0].variants[()]
        low, high = plot.limits
        assert low == 0.0
        assert 4.0 * distance < high < 0.5
        # However short the distance, there is something to see.
        assert np.any(np.isfinite(plot.panels[-1].layers[1].y))


@pytest.mark.parametrize("signal", [*SIGNALS, "own", "order", "frequency"])
def test_every_view_has_a_figure_and_an_effect_that_names_none_is_shown_over_its_own_torque(signal: str):
    random = np.random.default_rng(0)
    before = trace_of(swinging(random.standard_normal((2, 20000))))
    added = 0.1 * random.standard_normal((2, 20000))
    after = replace(before, predicted=added, residual=before.residual - added)
    chapter = Chapter(1, "mine", 0, [before], [after], BANDS, "joint1", View(signal))
    names = [figure.name for figure in chapter_group(load_robot(), chapter).figures]
    assert names == ([] if signal == "own" else ["effect-1-view"]) + ["effect-1-own"]
