"""As many recordings as tell the effects of a step, and back to all of them."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.linearised import linearise
from scara_ident.diagnosis.fitting.part_of_recordings import ENOUGH_SECONDS, _strengths, on_all, on_part
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.position import Spring
from scara_ident.estimation.run_offsets import offsets_on
from scara_ident.estimation.run_variation import KINDS, OFFSET, JointVariation, RunVariation
from tests.diagnosis.made import exact_runs, step_beside

ELASTIC = [Candidate(JointElasticity(), Member(j, (9.0 - j, 0.1))) for j in (0, 1)]


def names(step: SelectionStep) -> list[str]:
    return [item.name for item in step.observations.data.recordings]


def test_no_more_recordings_than_tell_the_effects():
    step = step_beside(exact_runs(), ELASTIC)
    part, told = on_part(step), _strengths(step)
    assert set(names(part)) < set(names(step))
    assert part.chosen == step.chosen
    seconds = 48.0 * np.sum(_strengths(part), axis=1) / np.sum(told, axis=1)
    assert np.all(seconds > 0.99 * ENOUGH_SECONDS)
    # Without the one of them that tells least it would be too little.
    best = np.sort(48.0 * told / np.sum(told, axis=1, keepdims=True), axis=1)[:, ::-1]
    assert np.min(np.sum(best[:, : len(names(part)) - 1], axis=1)) < ENOUGH_SECONDS


def test_all_recordings_where_fewer_tell_too_little():
    step = step_beside(exact_runs(1, 1), ELASTIC)
    assert on_part(step) is step


@pytest.mark.parametrize(
    ("told", "taken"),
    [
        ([[1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.1, 5.0]], [2, 3]),
        ([[0.0, 8.0, 0.0, 0.0], [0.0, 0.0, 8.0, 0.0]], [1, 2]),
        ([[8.0, 0.1, 0.1, 0.1], [4.0, 0.0, 0.0, 0.0]], [0]),
        ([[1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]], [0, 1, 2, 3]),
    ],
)
def test_those_that_tell_most_of_each_effect_are_taken(
    told: list[list[float]], taken: list[int], monkeypatch: pytest.MonkeyPatch
):
    step = step_beside(exact_runs(), ELASTIC)
    monkeypatch.setattr(sys.modules[on_part.__module__], "_strengths", lambda _: np.array(told))
    assert names(on_part(step)) == [names(step)[k] for k in taken]


def test_what_a_recording_tells_is_the_weighted_square_of_the_columns():
    step = step_beside(exact_runs(), [Candidate(Spring(), Member(1))])
    (told,) = _strengths(step)
    each = [step.observations.data.of([k]) for k in range(4)]
    for own, data in zip(told, each, strict=True):
        alone = step_beside(data.sources, step.chosen, step.weights)
        (rows,) = alone.columns.rows(alone.scene, alone.chosen)
        assert own == pytest.approx(step.weights[1] ** 2 * np.sum(rows[1] ** 2), rel=1e-9)


def test_fitted_there_they_are_the_same_effects_on_all():
    step = step_beside(exact_runs(), ELASTIC)
    part = on_part(step)
    moved = replace(part, chosen=tuple(item.at([7.0, 0.05]) for item in part.chosen))
    back = on_all(moved, step)
    assert names(back) == names(step) and back.columns is step.columns
    assert linearise(back).error == pytest.approx(linearise(replace(step, chosen=moved.chosen)).error, rel=1e-9)


def test_offsets_of_runs_are_those_of_the_runs_taken():
    step = step_beside(exact_runs(), ELASTIC)
    std = np.eye(len(KINDS))[OFFSET]
    own = [
        JointVariation(
            np.zeros((len(KINDS), rows.table.shape[1])), std, np.zeros((4, len(KINDS))), 1.0, rows.starts[[0, -1]],
            np.zeros((4, len(KINDS))),
        )
        for rows in step.observations.joints
    ]  # fmt: skip
    offsets = offsets_on(step.observations, RunVariation(tuple(own)))
    part = on_part(replace(step, variation=offsets))
    assert part.offsets is not None
    for item, rows in zip(part.offsets.joints, part.observations.joints, strict=True):
        assert item is not None and len(item.bounds) == 1 + len(names(part))
        assert item.directions.shape[1] == item.bounds[-1] == rows.table.shape[1]
