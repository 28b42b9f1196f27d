"""A recording that leaves more than all others: no noise, unless runs were seen to differ so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.evidence.even_evidence import MIN_RUNS, _Left, even_evidence
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations
from tests.diagnosis.made import observed, virtual_runs
from tests.estimation.test_run_variation import runs

SHOWN = tuple(Evidence(joint, True, "whiteness", "", 0.1) for joint in ("joint1", "joint2"))


def test_what_one_recording_leaves_more_of_than_all_others_is_no_noise():
    """A load of 2 kg in one of three recordings was as white as noise, and `complete` was said."""
    training = observed(virtual_runs())
    after = wls(training)
    assert even_evidence(SHOWN, after, training) == SHOWN
    rows = training.joints[1]
    own = training.owner == 2
    inside = np.repeat(own, np.diff(rows.starts))
    left = rows.table[-1] - after.value[rows.columns] @ rows.table[:-1]
    table = rows.table.copy()
    table[-1] += np.where(inside, left, 0.0)
    louder = replace(training, joints=(training.joints[0], replace(rows, table=table)))
    first, second = even_evidence(SHOWN, after, louder)
    assert first == SHOWN[0]
    name = training.data.recordings[2].name
    assert (
        not second.shown and second.why.startswith(f"{name} leaves ") and "times the error of all others" in second.why
    )
    assert second.apart == name
    # Of a single recording nothing is said.
    assert even_evidence(SHOWN, after, louder.of([2])) == SHOWN


@pytest.mark.parametrize(
    ("motions", "loud"),
    [
        # Noise that grows with the motion: both repetitions of one leave twice as much.
        (["a", "a", "b", "b", "c"], None),
        # The same of two motions.
        (["a", "d", "b", "b", "c"], 0),
        # One of two repetitions leaves more than the other.
        (["b", "c", "a", "a", "d"], 0),
    ],
)
def test_noise_that_a_motion_makes_each_time_is_no_recording_apart(motions: list[str], loud: int | None):
    """An arm that lacks nothing was `undecided`, by noise that grows with its speed."""
    rows = np.full(5, 400)
    squares = rows * np.array([4.1, 4.0 if motions[1] != "c" else 1.0, 1.0, 1.0, 1.0])
    found = _Left(squares, rows, np.array(motions), lambda place: 0.0).loudest(CRITERIA)
    assert (None if found is None else found[0]) == loud


def test_a_burst_of_noise_in_one_recording_is_no_recording_apart():
    """Torque with heavy tails: `undecided` by one burst, with nothing missing."""
    training = observed(virtual_runs())
    after = wls(training)
    rows = training.joints[1]
    left = rows.table[-1] - after.value[rows.columns] @ rows.table[:-1]
    (blocks,) = np.nonzero(training.owner == 2)

    def with_louder(some: np.ndarray, factor: float) -> Observations:
        inside = np.repeat(np.isin(np.arange(len(training.owner)), some), np.diff(rows.starts))
        table = rows.table.copy()
        table[-1] += np.where(inside, (factor - 1.0) * left, 0.0)
        return replace(training, joints=(training.joints[0], replace(rows, table=table)))

    # As much in all, once in a tenth of its blocks and once in most of them.
    few, most = blocks[: max(1, len(blocks) // 10)], blocks[: 9 * len(blocks) // 10]
    assert even_evidence(SHOWN, after, with_louder(few, 8.0)) == SHOWN
    _, second = even_evidence(SHOWN, after, with_louder(most, 8.0 * np.sqrt(len(few) / len(most))))
    assert not second.shown


def test_runs_that_differ_leave_more_and_less():
    """Of 60 sets with nothing missing, in half of which runs differ, 9 were `undecided` by that alone."""
    training = observed(runs(np.random.default_rng(0), (0.1, 0.03, 0.0, 0.0), seconds=6.0))
    after = wls(training)
    unknown = even_evidence(SHOWN, replace(after, variation=None), training)
    assert [item.shown for item in unknown] == [False, False]
    assert even_evidence(SHOWN, after, training) == SHOWN
    # So few might be one that carries something.
    few = training.of(range(MIN_RUNS - 1))
    assert not all(item.shown for item in even_evidence(SHOWN, wls(few), few))


@pytest.mark.parametrize("factor", [1.1, 1.5])
def test_one_run_that_is_unlike_all_others_is_no_run_that_differs(factor: float):
    made = runs(np.random.default_rng(1), (0.02, 0.0, 0.0, 0.0), seconds=6.0)
    assert all(item.shown for item in even_evidence(SHOWN, wls(observed(made)), observed(made)))
    made[3] = replace(made[3], effort=made[3].effort * np.array([[factor], [1.0]]))
    training = observed(made)
    after = wls(training)
    assert after.variation is not None and after.variation.joints[0] is not None
    first, second = even_evidence(SHOWN, after, training)
    assert not first.shown and first.why.startswith("D3_1 leaves ")
    assert second == SHOWN[1]
