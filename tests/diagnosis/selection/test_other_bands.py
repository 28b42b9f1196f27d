"""A search told in other bands: every part of it is of these, and what stayed and what did not is as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import columns_at_hand
from scara_ident.diagnosis.selection.other_bands import in_bands_of
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.selection_step import observed
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.estimation import wls
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.recording.recording import Recording
from tests.diagnosis.made import exact_runs, searched, with_torque

LOWER = (5.0, 5.0)


def sprung_runs(late: float = 0.0) -> list[Recording]:
    """Runs with a spring on the second joint, later by so many s."""
    return [shifted(run, -late) for run in with_torque(exact_runs(), 1, lambda motion: 0.3 * motion.q[1])]


def moved(found: Search) -> Search:
    columns = found.step.columns.at(LOWER)
    scene = replace(found.scene, band=max(LOWER), columns=columns_at_hand(columns.observations))
    return in_bands_of(found, replace(found.step, scene=scene, columns=columns))


def test_all_of_it_is_of_the_other_bands() -> None:
    found = searched(sprung_runs(), Spring(), Stribeck())
    lower = moved(found)
    assert [item.label(lower.scene) for item in lower.chosen] == ["spring of joint2"]
    assert lower.bands == lower.uncorrected.data.bands == LOWER
    assert lower.first.band == lower.scene.band == 5.0
    assert np.array_equal(lower.start.value, wls(lower.uncorrected).value)
    # What came in is as large as it is there, and so is what it left.
    fitted = observed(lower.step)
    value, weights = value_and_weights(fitted)
    assert lower.step.weights == pytest.approx(weights, rel=1e-6)
    (step,) = lower.steps
    assert step.data.bands == LOWER
    assert step.value == pytest.approx(value)
    assert step.rms == pytest.approx(rms_of(value, fitted))
    assert step.decision is found.steps[0].decision


def test_what_was_tried_beside_it_is_judged_there_and_comes_in_nowhere() -> None:
    found = searched(sprung_runs(), Spring(), Stribeck())
    item = found.decisions[0]
    refused = replace(
        found, decisions=(replace(item, candidate=found.chosen[0]).refused("as it was"), *found.decisions)
    )
    bare = replace(refused, step=refused.step.without(0), steps=())
    first, *others = moved(bare).decisions
    assert (first.accepted, first.why) == (False, "as it was")
    alone = moved(bare).step.judge([each.candidate for each in found.decisions])
    assert [each.gain for each in others] == pytest.approx([each.gain for each in alone])


@pytest.mark.slow
def test_what_was_taken_out_of_the_data_stays_out_and_is_in_the_base_model_before_it() -> None:
    found = searched(sprung_runs(0.006), Spring(), TimeDelay())
    assert found.correction is not None
    lower = moved(found)
    assert lower.correction is found.correction
    assert lower.data.bands == LOWER
    corrected, before = (rms_of(wls(each).value, each) for each in (lower.step.observations, lower.uncorrected))
    assert max(np.array(before) / np.array(corrected)) > 1.05
    assert {step.data.bands for step in lower.steps} == {LOWER}
