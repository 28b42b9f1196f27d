"""What changed, since when, and that nothing else is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.fleet.causes import Cause
from scara_ident.fleet.changes import (
    FALSE_CHANGE_LEVEL,
    _best_of,
    _Named,
    _needed,
    _search,
    _Trial,
    find_changes,
    grown_residuals,
    residual_scatter,
    trials_of,
)
from scara_ident.fleet.history import History
from scara_ident.fleet.scatter import fleet_scatter
from scara_ident.fleet.visit import Visit, _visit
from tests.fleet.made import DATES, WEAR, WORN, run_of


def with_dates(history: History, count: int) -> History:
    return replace(history, dates=history.dates[:count], visits=history.visits[:count])


@pytest.fixture(scope="module")
def noise(histories):
    return fleet_scatter(histories)


@pytest.mark.slow
def test_the_worn_arm_is_named_with_cause_joint_size_and_date_and_no_other(histories, noise):
    found = {item.arm: find_changes(item, noise, 400.0) for item in histories}
    assert [arm for arm, changes in found.items() if changes] == [WORN]
    first = found[WORN][0]
    assert first.cause is not None
    assert first.cause.words == "Coulomb friction of joint2" and first.joint == "joint2"
    assert first.since in DATES[1:4] and first.gradual
    assert abs(first.size[0] - (WEAR[-1] - 1.0)) < 4.0 * np.sqrt(first.covariance[0, 0]) + 0.03
    assert first.p_value < FALSE_CHANGE_LEVEL and first.score > 5.0


def test_one_date_tells_no_change(histories, noise):
    assert find_changes(with_dates(histories[1], 1), noise, 400.0) == ()


def test_more_arms_ask_for_more(histories, noise):
    few = find_changes(histories[1], noise, 400.0)[0]
    many = find_changes(histories[1], noise, 40000.0)[0]
    np.testing.assert_allclose(many.p_value, 100.0 * few.p_value)


def test_a_cause_that_changes_twice_has_the_size_of_each_step(histories):
    """The surest change took up the other one: 0.27 where 0.25 came."""
    model, before = histories[0].model, (0.0, 0.05, 0.05, 0.3)
    visits: list[Visit] = []
    for date, stiffness in enumerate(before):
        run = run_of(2, date)
        effort = run.effort.copy()
        effort[0] += stiffness * run.position[0]
        visits.append(_visit(model, [replace(run, effort=effort)], visits[0].reference if visits else None))
    stiffer = History(WORN, DATES[:4], tuple(visits), model)
    fleet = [stiffer if item.arm == WORN else with_dates(item, 4) for item in histories]
    found = find_changes(stiffer, fleet_scatter(fleet), 400.0)
    assert {item.cause.label for item in found if item.cause} == {"spring of joint1"}
    # Their standard deviations are 0.0002: friction differs from date to date.
    sizes = {item.since: pytest.approx(item.size[0], abs=0.002) for item in found}
    assert sizes == {DATES[1]: 0.05, DATES[3]: 0.25}


def test_many_sizes_come_before_one_that_leaves_most_of_a_large_change():
    """A payload of a UR5 was named as torque scales of its elbow and shoulder and a spring, with 19.2 degrees of freedom."""

    def cause(sizes: int) -> Cause:
        return Cause("", None, "", (), ("1",) * sizes)

    def trial(place: int, explained: float) -> _Trial:
        return _Trial(place, 0, explained, 0.0, 0.0, np.zeros(1), np.zeros((1, 1)))

    one, many = cause(1), cause(40)
    scale, payload = trial(0, 395514.0), trial(1, 2256536.0)
    assert _best_of([scale, payload], (one, many), 19.2, 400.0) is payload
    # What chance makes of forty sizes is no reason.
    assert _best_of([scale, trial(1, scale.explained + 80.0)], (one, many), 19.2, 400.0) is scale
    # Nor is a cause of as many sizes that explains more: it is in order already.
    assert _best_of([scale, trial(1, 2.0 * scale.explained)], (one, one), 19.2, 400.0) is scale
    # A sign that was swapped is one torque scale, and no masses explain as much.
    assert _best_of([trial(0, 811686.0), trial(1, 534932.0)], (one, many), 19.2, 400.0).cause == 0


def test_what_came_first_is_not_named_where_a_later_cause_leaves_nothing_of_it(histories, noise):
    """Friction as a whole was named with 0.6 % (± 1 %) beside its Coulomb part, which was what had grown."""
    worn, search = histories[1], _search(histories[1], noise)
    labels = [cause.label for cause in worn.causes]
    both = []
    for label in ("friction of joint2", "Coulomb friction of joint2"):
        trial = search.best(labels.index(label), worn.causes[labels.index(label)])
        assert trial is not None and trial.p_value * 400.0 < FALSE_CHANGE_LEVEL
        both.append(_Named(trial, trial, ()))
    (left,) = _needed(both, search, worn.causes, 400.0)
    assert left.trial is both[1].trial
    np.testing.assert_allclose(left.beside.size, left.trial.size)
    assert _needed(both[:1], search, worn.causes, 400.0)[0].trial is both[0].trial


def test_where_dates_differ_more_by_nature_less_is_named(histories, noise):
    rough = replace(
        noise, runs=300.0 * noise.runs, causes={label: 5000.0 * ratio for label, ratio in noise.causes.items()}
    )
    assert find_changes(histories[1], rough, 400.0) == ()


def test_a_residual_that_grew_is_named_where_no_cause_is(histories):
    arm = histories[0]
    worse = tuple(
        replace(visit, error=visit.error * np.array([1.0, 1.0 if k < 3 else 4.0])) for k, visit in enumerate(arm.visits)
    )
    grown = replace(arm, visits=worse)
    tried = 400.0
    (found,) = grown_residuals(grown, *residual_scatter([grown, *histories[1:]]), tried)
    assert found.cause is None and found.joint == "joint2" and found.since == DATES[3]
    np.testing.assert_allclose(found.size[0], 3.0, rtol=0.3)
    assert grown_residuals(histories[3], *residual_scatter(histories), tried) == ()


def test_the_tests_of_an_arm_are_worth_fewer_than_they_are_many_and_more_dates_ask_for_more(histories, noise):
    arm = histories[0]
    shapes = 2 * len(arm.dates) - 3
    few, many = trials_of(with_dates(arm, 2), noise), trials_of(arm, noise)
    assert 5.0 < few < many < shapes * len(arm.causes)


def test_what_dates_differ_by_in_one_size_widens_that_one_only(histories, noise):
    arm = histories[0]
    k, cause = next((k, item) for k, item in enumerate(arm.causes) if item.sizes == 2)
    assert noise.causes[cause.label].shape == (2,) and np.all(noise.causes[cause.label] >= 1.0)
    step = [(1, False, (np.arange(len(arm.dates)) >= 1).astype(float))]
    ratios = [np.ones(2), np.array([1.0, 25.0])]
    even, uneven = (
        replace(_search(arm, replace(noise, causes={cause.label: ratio})), shapes=step).best(k, cause)
        for ratio in ratios
    )
    assert even is not None and uneven is not None
    np.testing.assert_allclose(uneven.covariance, even.covariance * np.array([[1.0, 5.0], [5.0, 25.0]]))
    for trial in (even, uneven):
        expected = trial.size @ np.linalg.solve(trial.covariance, trial.size)
        np.testing.assert_allclose(trial.explained, expected, rtol=1e-6)
