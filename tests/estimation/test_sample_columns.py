"""Columns at every sample: of more samples than are held they are made anew, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import sample_columns, wls
from scara_ident.estimation.sample_columns import SampleColumns, evenly, few_enough
from scara_ident.identification.identify import identify
from tests.diagnosis.made import exact_runs, observed


@pytest.fixture
def nothing_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_columns, "MAX_VALUES", 1)


def test_few_samples_are_held_and_many_are_not(monkeypatch: pytest.MonkeyPatch):
    seen = observed(exact_runs())
    assert few_enough(seen.data)
    assert all(held is not None for held in seen.raw.held)
    monkeypatch.setattr(sample_columns, "MAX_VALUES", seen.samples * 2 - 1)
    assert not few_enough(seen.data)
    assert observed(exact_runs()).raw.held == (None,) * len(exact_runs())


def test_what_is_made_anew_is_what_would_be_held(nothing_held: None):
    anew = observed(exact_runs())
    held = SampleColumns(anew.model, anew.data.recordings, tuple(anew.raw))
    assert len(held) == len(anew.raw) == len(exact_runs())
    for place, recording in enumerate(held):
        for mine, other in zip(recording, anew.raw[place], strict=True):
            assert all(np.array_equal(a, b) for a, b in zip(mine, other, strict=True))
    (last,) = anew.raw.of([len(held) - 1])
    assert np.array_equal(last[0][0], held[len(held) - 1][0][0])


def test_predictions_and_errors_are_the_same(monkeypatch: pytest.MonkeyPatch):
    held = observed(exact_runs())
    value = wls(held).value
    monkeypatch.setattr(sample_columns, "MAX_VALUES", 1)
    anew = observed(exact_runs())
    for mine, other in zip(held.predicted(value), anew.predicted(value), strict=True):
        assert np.array_equal(mine, other)
    assert np.array_equal(held.unfiltered_rms(value), anew.unfiltered_rms(value))
    assert np.array_equal(held.of([1]).predicted(value)[0], anew.of([1]).predicted(value)[0])


def test_an_identification_is_the_same(monkeypatch: pytest.MonkeyPatch):
    """But for the draw of noise that its bias is measured with, of which runs without steps or scatter have none."""
    runs = exact_runs()
    robot = observed(runs).model.robot
    held = identify(robot, runs[:-1], validation=runs[-1:])
    monkeypatch.setattr(sample_columns, "MAX_VALUES", 1)
    anew = identify(robot, runs[:-1], validation=runs[-1:])
    assert np.array_equal(held.estimate.value, anew.estimate.value)
    assert np.array_equal(held.estimate.std, anew.estimate.std)
    assert held.training_errors() == anew.training_errors()
    assert held.validation_errors() == anew.validation_errors()
    assert held.notes == anew.notes


def test_rows_alone_have_no_columns_at_every_sample():
    seen = observed(exact_runs())
    assert not replace(seen, raw=seen.raw.of(())).raw


@pytest.mark.parametrize(
    ("count", "number", "places"), [(6, 3, [1, 3, 5]), (5, 1, [2]), (4, 4, [0, 1, 2, 3]), (3, 0, [])]
)
def test_places_lie_evenly(count: int, number: int, places: list[int]):
    assert evenly(count, number) == places
