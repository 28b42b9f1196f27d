"""Directions of change: each is what the torque of the joints really changes by."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.fleet.causes import REPORTED_RUN_KINDS, RUN_KINDS, run_directions, sizes_in_words
from tests.fleet.made import DATES, quill_fleet


@pytest.mark.slow
def test_the_direction_of_a_share_is_that_share_of_the_parameters(histories):
    history = histories[0]
    value, columns = history.scene.value, history.visits[0].columns
    names = history.model.names
    by_words = {cause.words: cause for cause in history.causes}
    coulomb = by_words["Coulomb friction of joint2"]
    assert coulomb.units == ("1",) and coulomb.effect == "friction" and coulomb.joint == "joint2"
    place = names.index("a02")
    assert not np.any(coulomb.weights[0])
    np.testing.assert_array_equal(coulomb.weights[1][:, 0], np.where(columns[1] == place, value[place], 0.0))
    scale = by_words["torque scale of joint1"]
    np.testing.assert_array_equal(
        scale.weights[0][columns[0] < len(value), 0], value[columns[0][columns[0] < len(value)]]
    )
    assert not np.any(scale.weights[1])


@pytest.mark.slow
def test_every_cause_has_a_name_of_its_own_and_acts_somewhere(histories):
    causes = histories[0].causes
    assert len({cause.label for cause in causes}) == len(causes)
    assert all(any(np.any(rows) for rows in cause.weights) for cause in causes)
    effects = [cause for cause in causes if cause.candidate is not None]
    used = np.concatenate([np.flatnonzero(np.any(np.array(cause.weights[1]) != 0.0, axis=1)) for cause in effects])
    assert len(used) == len(set(used))


@pytest.mark.slow
def test_what_differs_from_run_to_run_has_five_directions_on_each_joint(histories):
    history = histories[0]
    first = history.visits[0]
    effects = max(own.max() for own in first.columns) + 1 - len(history.model.columns) - 2
    rows = run_directions(history.model, history.scene.value, first.columns, effects)
    for j, (own, weights) in enumerate(zip(first.columns, rows, strict=True)):
        assert weights.shape == (len(own), len(RUN_KINDS))
        assert np.count_nonzero(weights[:, 3]) == 1 == np.count_nonzero(weights[:, 4])
        assert own[np.argmax(weights[:, 4])] == len(history.model.columns) + effects + j
        # Coulomb friction, and all of it that grows with speed.
        assert [np.count_nonzero(weights[:, part]) for part in (0, 1)] == [1, 3]
        friction = next(cause for cause in history.causes if cause.words == f"friction of joint{j + 1}")
        np.testing.assert_array_equal((weights @ REPORTED_RUN_KINDS)[:, 0], friction.weights[j][:, 0])
    assert len(history.dates) == len(DATES)


def test_sizes_are_reported_as_an_effects_parameters(histories):
    history = histories[0]
    ripple = next(cause for cause in history.causes if cause.effect == "torque_ripple")
    told = sizes_in_words(ripple, history.scene, np.array([0.03, 0.04]), np.eye(2) * 1e-6)
    assert list(told) == ["amplitude"]
    np.testing.assert_allclose(told["amplitude"].value, 0.05)
    assert told["amplitude"].unit == "N m"
    own = sizes_in_words(history.causes[0], history.scene, np.array([0.1]), np.array([[1e-4]]))
    assert own[""].value == 0.1 and own[""].unit == "1"


@pytest.mark.slow
def test_an_offset_that_weight_stands_for_is_a_cause_of_its_own_and_differs_from_run_to_run():
    history = quill_fleet(0, (0.0, 0.0, 0.0, 0.0))[0]
    joint = history.model.robot.joints[2]
    (offset,) = (cause for cause in history.causes if cause.effect == "offset" and cause.joint == joint)
    assert offset.words == f"torque offset of {joint}" and offset.units == (history.model.robot.torque_unit(2),)
    rows = history.rows[0]
    k = history.causes.index(offset)
    assert np.linalg.norm(rows.directions[k]) > 0.0
    np.testing.assert_allclose(rows.runs[:, len(RUN_KINDS) * 2 + RUN_KINDS.index("offset")], rows.directions[k][:, 0])


@pytest.mark.slow
def test_a_change_of_masses_is_a_payload_where_a_body_on_the_last_link_makes_it():
    history = quill_fleet(0, (0.0, 0.0, 0.0, 0.0))[0]
    term, scene = history.model.rigid_body, history.scene
    cause = next(cause for cause in history.causes if cause.effect == "inertia")
    body = np.array([1.5, 0.03, -0.02, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0, 0.02])
    random = np.random.default_rng(0)
    root = random.standard_normal((cause.sizes, cause.sizes)) * 1e-3
    change = term.base.grouping[term.kept, 20:30] @ body
    told = sizes_in_words(cause, scene, change, root @ root.T)
    assert list(told) == ["mass"] and told["mass"].unit == "kg"
    np.testing.assert_allclose(told["mass"].value, 1.5, rtol=1e-6)
    # As sure as least squares beside the other nine would have it.
    columns = np.linalg.solve(root, term.base.grouping[term.kept, 20:30])
    np.testing.assert_allclose(told["mass"].std, np.sqrt(np.linalg.pinv(columns.T @ columns)[0, 0]), rtol=1e-4)
    # A body on the first link makes another change.
    other = term.base.grouping[term.kept, 0:10] @ body
    assert sizes_in_words(cause, scene, other, root @ root.T) == {}
