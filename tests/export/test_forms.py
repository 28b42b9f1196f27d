"""What formats can say, and friction fitted again to what they cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.payload import PayloadChange
from scara_ident.errors import EstimationError
from scara_ident.estimation.information import Information
from scara_ident.export.forms import FORMS, Form, friction_said, offset_said, possible_standard, said_by, with_code
from scara_ident.model.terms import Friction, Offset, RigidBody
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf
from tests.export.arms import scara
from tests.export.identified import identified


def places(found, kind, powers=(0, 1)) -> list[int]:
    result = []
    for term in found.model.terms:
        if isinstance(term, kind):
            start = found.model.place(term).start
            wanted = range(len(term.columns))
            result += [start + k for k in wanted if kind is Offset or term.powers[k % len(term.powers)] in powers]
    return result


def test_a_form_that_has_a_place_for_all_changes_nothing(models):
    for found in models.values():
        said = said_by(with_code(FORMS["mjcf"]), found, found.standard)
        np.testing.assert_allclose(said.value, found.value, rtol=1e-9)
        assert (said.missing, said.refitted) == ((), ())


def test_friction_is_fitted_again_as_least_squares_on_the_same_rows_has_it(models):
    found = models["ur5", True]
    form = Form(bodies=False, powers=(0, 1), armature=True, offset=True, effects=False)
    said = said_by(form, found)
    free = sorted(places(found, Friction) + places(found, Offset))
    assert said.refitted == tuple(found.model.names[k] for k in free)
    information = found.information
    rows, target = information.factor[:, :-1], information.factor[:, -1]
    rigid = found.model.place(found.model.rigid_body)
    expected = np.zeros_like(found.value)
    expected[rigid] = found.value[rigid]
    expected[free] = np.linalg.lstsq(rows[:, free], target - rows @ expected, rcond=None)[0]
    np.testing.assert_allclose(said.value, expected, rtol=1e-6, atol=1e-8)
    # Not worse than what is left when terms are merely dropped.
    dropped = np.where(np.isin(np.arange(len(expected)), [*free, *range(rigid.start, rigid.stop)]), found.value, 0.0)
    assert information.residual_sum(said.value) < 0.5 * information.residual_sum(dropped)


def test_friction_of_a_form_with_bodies_brakes(models):
    for found in models.values():
        said = said_by(FORMS["pinocchio"], found, found.standard)
        assert np.all(said.value[places(found, Friction)] >= 0.0)
        assert np.all(said.value[places(found, Friction, (2, 3))] == 0.0)
        assert np.all(offset_said(found, said.value) == 0.0)
        friction = friction_said(found, said.value)
        np.testing.assert_array_equal(friction.coulomb, said.value[places(found, Friction, (0,))])


def test_what_is_missing_is_named_with_why(tmp_path: Path):
    found = replace(identified(scara(tmp_path), ("warm_up", "spring"), samples=60), found=({"effect": "time_delay"},))
    missing = dict(said_by(FORMS["c"], found).missing)
    assert missing == {
        "warm_up of joint2": "it does not follow from position, velocity and acceleration at the moment",
        "time_delay": "it was corrected in the recordings",
    }
    names = dict(said_by(FORMS["urdf"], found, found.standard).missing)
    assert {"armature", "a21, a31, a22, a32", "p_o1, p_o2", "spring of joint2"} < set(names)


def test_of_a_lift_whose_weight_takes_up_the_offset_no_offset_is_missing(tmp_path: Path):
    """It has no column: to write the URDF ended in an internal error, of `identify` too."""
    lift = load_robot(write_urdf(tmp_path / "lift.urdf", [Link(kind="prismatic")]))
    found = identified(lift, samples=60)
    assert found.standard is not None
    assert [what for what, _ in said_by(FORMS["urdf"], found, found.standard).missing] == ["armature", "a21, a31"]


def test_friction_does_not_stand_in_for_what_was_carried_at_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # In the second half of the states, and not after all of them.
    monkeypatch.setattr(PayloadChange, "members", lambda self, scene: (Member(None, (30.0 / 1e9,)),))
    arm = scara(tmp_path)
    carried = identified(arm, ("payload_change",), samples=60)
    said = said_by(FORMS["c"], carried)
    assert said.refitted == ()
    assert said.missing == (("payload_change", "it was there only at times; the arm is written without it"),)
    term = carried.model.terms[-1]
    np.testing.assert_array_equal(said.value[: carried.model.place(term).start], carried.value[:-1])
    assert said.value[-1] == 0.0
    # What takes the place of a spring is the same whether or not a body was carried in the recordings.
    both = identified(arm, ("payload_change", "spring"), samples=60)
    form = Form(bodies=False, powers=(0, 1), armature=True, offset=True, effects=False)
    said = said_by(form, both)
    assert said.refitted
    free = sorted(places(both, Friction) + places(both, Offset))
    rows, target = both.information.factor[:, :-1], both.information.factor[:, -1]
    rest = np.zeros_like(both.value)
    for term in both.model.terms:
        if isinstance(term, RigidBody) or term.name == "payload_change":
            rest[both.model.place(term)] = both.value[both.model.place(term)]
    expected = np.linalg.lstsq(rows[:, free], target - rows @ rest, rcond=None)[0]
    np.testing.assert_allclose(said.value[free], expected, rtol=1e-6, atol=1e-8)


def test_friction_that_no_recording_determined_is_not_known(tmp_path: Path):
    found = identified(scara(tmp_path), samples=60)
    open_ = found.undetermined.copy()
    open_[places(found, Friction, (1,))[1]] = True
    friction = friction_said(replace(found, undetermined=open_), found.value)
    assert np.isnan(friction.viscous[1]) and np.isfinite(friction.viscous[0])


def test_an_arm_that_can_exist_is_found_from_the_factors_alone(tmp_path: Path):
    found = replace(identified(scara(tmp_path)), standard=None)
    value = found.information.solve().value
    standard, notes = possible_standard(replace(found, value=value))
    rigid = found.model.rigid_body
    base = (rigid.base.grouping @ standard)[rigid.kept]
    np.testing.assert_allclose(base, value[found.model.place(rigid)], rtol=1e-8)
    assert notes == ()
    # Observations of an arm whose second link has a negative inertia.
    wrong = found.value.copy()
    wrong[found.model.names.index("P_d4")] = -0.5
    fitted = tuple(_answering(item, wrong) for item in found.fitted)
    standard, notes = possible_standard(replace(found, value=wrong, fitted=fitted))
    assert "the identified parameters are not physically consistent" in notes[0]
    assert np.all(np.linalg.eigvalsh(standard[14:20][[[0, 1, 3], [1, 2, 4], [3, 4, 5]]]) > -1e-9)
    with pytest.raises(EstimationError, match="contains no observations"):
        possible_standard(replace(found, fitted=tuple(Information.empty(len(value)) for _ in range(2))))


def _answering(item: Information, value: np.ndarray) -> Information:
    """The same rows with the torque of other parameters and some noise."""
    factor = item.factor.copy()
    factor[:, -1] = factor[:, :-1] @ value + 1e-3 * np.random.default_rng(0).standard_normal(len(factor))
    return Information(factor, item.rows)
