"""Repetitions are told by the motion, not by the name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.motion.motion import Stretch
from scara_ident.motion.trajectories import alignment, trajectories_of
from scara_ident.recording.recording import split_name


def run(
    motion: int, name: str, *, start: float = 0.0, rate: float = 200.0, seconds: float = 8.0, seed: int = 0, n: int = 2
) -> Stretch:
    """A recording of one of many motions, from ``start`` seconds into it."""
    rng = np.random.default_rng(1000 + motion)
    time = np.arange(round(seconds * rate)) / rate
    q = np.zeros((n, len(time)))
    for order in range(1, 8):
        size, phase = rng.normal(size=(n, 1)) / order, rng.uniform(0.0, 2.0 * np.pi, (n, 1))
        q += size * np.sin(2.0 * np.pi * 0.15 * order * (time + start) + phase)
    q += 1e-4 * np.random.default_rng(seed).standard_normal(q.shape)
    return Stretch(name, split_name(name)[0], time, q, None, rate, slice(0, len(time)))


def groups(stretches: Sequence[Stretch]) -> set[frozenset[str]]:
    labels = trajectories_of(stretches).labels
    return {
        frozenset(item.name for item, own in zip(stretches, labels, strict=True) if own == label) for label in labels
    }


def test_names_that_agree_with_the_motions_are_kept():
    found = trajectories_of([run(1, "a_1"), run(2, "b_1"), run(1, "a_2", seed=1), run(2, "b_2", seed=2)])
    assert found.labels == ("a", "b", "a", "b")
    assert found.notes == ()


def test_fourteen_names_for_seven_motions_twice_are_seven_trajectories():
    found = trajectories_of([run(k // 2, f"X_{k:02}", seed=k) for k in range(14)])
    assert found.labels == tuple(f"X_{2 * (k // 2):02}" for k in range(14))
    (note,) = found.notes
    assert note == "X_00, X_01 ... X_13 are 7 different motions, so they are not all repetitions of X"


def test_different_motions_of_one_name_are_no_repetitions():
    found = trajectories_of([run(k, f"X_{k}") for k in range(7)])
    assert len(set(found.labels)) == 7


def test_equal_motions_under_other_names_are_repetitions():
    found = trajectories_of([run(1, "morning"), run(2, "other"), run(1, "noon", seed=1), run(1, "noon_2", seed=2)])
    assert found.labels == ("noon", "other", "noon", "noon")
    assert found.notes == (
        "morning, noon, noon_2 have the same motion under the names morning, noon: they count as repetitions",
    )
    pieces = trajectories_of([run(1, "run_part"), run(1, "again_part", seed=1)])
    assert pieces.notes == ("again_part, run_part have the same motion: they count as repetitions",)


def test_an_odd_run_leaves_the_name_to_the_others():
    found = trajectories_of([run(2, "a_1"), run(1, "a_2"), run(1, "a_3", seed=1)])
    assert found.labels == ("a_1", "a", "a")


def test_labels_stay_apart_where_names_clash():
    """A recording named like another's trajectory."""
    found = trajectories_of([run(1, "a_1"), run(2, "a_2"), run(3, "a_1_1")])
    assert len(set(found.labels)) == 3


def test_a_joint_that_stands_still_says_nothing_by_its_noise():
    one, other = run(1, "a_1"), run(1, "a_2", seed=1)
    for item in (one, other):
        item.position[1] = 0.4 + 1e-4 * np.random.default_rng(len(item.name)).standard_normal(len(item.time))
    other.position[1] += 5e-5 * np.random.default_rng(3).standard_normal(len(other.time))
    assert groups([one, other]) == {frozenset(["a_1", "a_2"])}
    other.position[1] += 0.5
    assert len(groups([one, other])) == 2


def test_a_piece_of_a_run_is_not_its_repetition_unless_it_holds_half_of_it():
    assert len(groups([run(1, "a_1"), run(1, "a_2", seconds=3.0)])) == 2
    assert len(groups([run(1, "a_1"), run(1, "a_2", seconds=5.0)])) == 1


def test_runs_at_rest_are_not_those_that_begin_at_rest():
    """Two quarters of a KUKA's log, at rest and about to move by twenty times as much, were taken for repetitions."""
    resting, later = run(1, "a_1", seconds=4.0), run(1, "b_1", seconds=4.0, seed=1)
    resting.position[:] = 1e-4 * np.random.default_rng(2).standard_normal(resting.position.shape)
    begins = np.clip(later.time - 3.0, 0.0, None) ** 2
    later.position[:] = resting.position[:, ::-1] + np.array([[0.1], [0.2]]) * begins
    assert len(groups([resting, later])) == 2
    again = run(1, "b_2", seconds=4.0)
    again.position[:] = later.position + 1e-4 * np.random.default_rng(3).standard_normal(later.position.shape)
    assert groups([resting, later, again]) == {frozenset(["a_1"]), frozenset(["b_1", "b_2"])}


def test_short_and_empty_input():
    assert trajectories_of([]).labels == ()
    assert trajectories_of([run(1, "a_1", seconds=0.03)]).labels == ("a",)
    assert len(trajectories_of([run(1, "a_1", seconds=0.03), run(1, "b_1", seconds=0.03)]).labels) == 2


@settings(max_examples=25, deadline=None)
@given(
    order=st.permutations(range(6)),
    names=st.lists(st.sampled_from(["a", "b", "c_1", "c_2", "a_3", "d"]), min_size=6, max_size=6, unique=True),
    starts=st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6),
    rates=st.lists(st.sampled_from([100.0, 200.0, 317.0, 1000.0]), min_size=6, max_size=6),
)
def test_groups_depend_on_the_motion_alone(order: list[int], names: list[str], starts: list[float], rates: list[float]):
    """Whatever the order, the names, the beginning of a run and the sample rate."""
    motions = (0, 0, 1, 2, 2, 2)
    made = [run(motions[k], names[k], start=starts[k], rate=rates[k], seed=k) for k in range(6)]
    expected = {frozenset(names[k] for k in range(6) if motions[k] == motion) for motion in range(3)}
    assert groups([made[k] for k in order]) == expected
    forth, mixed = trajectories_of(made).labels, trajectories_of([made[k] for k in order]).labels
    assert mixed == tuple(forth[k] for k in order)


@pytest.mark.parametrize("shift", [-30, 0, 17])
def test_the_shift_is_found(shift: int):
    reference, other = run(3, "a_1"), run(3, "a_2", start=shift / 200.0, seed=1)
    assert alignment(reference.position, other.position, 100) == shift


def test_half_a_sample_of_a_fast_motion_is_no_other_motion():
    time = np.arange(400) / 100.0
    fast = [np.sin(2.0 * np.pi * 2.0 * (time + start))[None] for start in (0.0, 0.005)]
    # Laid sample on sample, they differ by 2 % of their range.
    assert alignment(*fast, 20) in (0, 1)
