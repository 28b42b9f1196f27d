from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.feasibility import check_possible
from scara_ident.estimation.consistent.options import ConsistentOptions, Ellipsoid
from scara_ident.estimation.consistent.unknowns import build_unknowns
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.estimation.consistent.arms import parameters, with_last_body, wrist_model
from tests.estimation.consistent.test_bodies import point_mass, thin_rod


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return wrist_model(tmp_path_factory.mktemp("wrist"))


def test_the_nominal_arm_can_exist(model):
    found = check_possible(model, parameters(model, with_last_body(model.robot, point_mass(1.0, (0.1, 0.05, 0.02)))))
    assert found.possible
    assert found.reasons == ()
    assert found.margin >= -1e-7


def test_a_thin_rod_can_exist(model):
    assert check_possible(model, parameters(model, with_last_body(model.robot, thin_rod(1.5, 0.4)))).possible


def test_a_wrong_signed_product_of_inertia_is_refused_by_name(model):
    body = point_mass(2.0, (0.1, -0.2, 0.3))
    body[5] *= -1.0
    found = check_possible(model, parameters(model, with_last_body(model.robot, body)))
    assert not found.possible
    assert found.margin < -1e-3
    assert any("I3xy = " in reason and "no bodies with mass" in reason for reason in found.reasons)
    # Each of the parameters named is needed for the contradiction, so its true value is not contradicted.
    body[5] *= -1.0
    assert check_possible(model, parameters(model, with_last_body(model.robot, body))).possible


def test_a_negative_inertia_is_refused_in_words():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    value[model.names.index("P_d4")] = -0.59
    found = check_possible(model, value)
    assert not found.possible
    assert found.reasons[0] == "P_d4 = I2z = -0.59 kg m^2 cannot be negative"


def test_base_parameters_that_contradict_each_other_are_named_and_no_others():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    # I2z >= (m2 s2x)^2 / m2 and m2 l1^2 < P_d1 bound each other: 2.415^2 0.33^2 / 16.165 = 0.039.
    value[model.names.index("P_d4")] = 0.03
    found = check_possible(model, value)
    (reason,) = found.reasons
    assert all(name in reason for name in ("P_d1", "P_d2", "P_d4"))
    assert "P_d3" not in reason
    assert "P_d5" not in reason
    value[model.names.index("P_d4")] = 0.041
    assert check_possible(model, value).possible


def test_friction_that_pushes_or_is_too_much_for_the_motor_is_told_with_its_speeds():
    model = build_model(load_robot(), "complete")
    value = parameters(model, model.robot.standard_parameters(), (0.1, 0.1))
    # 0.27 - 1.2 v + v^2 is negative between 0.3 and 0.9.
    for name, number in {"a01": 0.27, "a11": -1.2, "a21": 1.0, "a31": -0.1, "a12": 0.6}.items():
        value[model.names.index(name)] = number
    found = check_possible(model, value)
    assert not found.possible
    pushing, too_much = sorted(found.reasons)[1], sorted(found.reasons)[0]
    assert pushing.startswith("friction of joint1 pushes between 0.29") or "exceeds" in pushing
    assert any(reason.startswith("friction of joint2 exceeds the motor's limit of 2 N m above 3.17") for reason in
               found.reasons), too_much  # fmt: skip


def test_the_number_of_parameters_is_checked(model):
    with pytest.raises(UsageError, match="finite parameters of the model basic"):
        check_possible(model, np.zeros(3))
    with pytest.raises(UsageError, match="finite"):
        check_possible(model, np.full(len(model.columns), np.nan))


def test_limits_on_masses_and_centres_of_mass_count(model):
    value = parameters(model, with_last_body(model.robot, point_mass(1.0, (0.1, 0.05, 0.02))))
    inside = ConsistentOptions(
        link_mass={"l3": (1.0, 0.1)}, com={"l3": Ellipsoid((0.1, 0.05, 0.0), (0.05, 0.05, 0.05))}
    )
    assert check_possible(model, value, unknowns=build_unknowns(model, inside)).possible
    # The first moments are told by gravity: a link of twice the mass has its centre of mass at half the distance.
    outside = ConsistentOptions(
        link_mass={"l3": (2.0, 0.1)}, com={"l3": Ellipsoid((0.1, 0.05, 0.0), (0.02, 0.02, 0.05))}
    )
    assert not check_possible(model, value, unknowns=build_unknowns(model, outside)).possible


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"link_mass": {"nose": (1.0, 0.1)}}, "neither an identified link nor joint"),
        ({"com": {"l1": Ellipsoid((0, 0, 0), (0.1, 0.0, 0.1))}}, "radius"),
        ({"speed": {"nose": 1.0}}, "no identified joint"),
    ],
)
def test_options_that_name_nothing_are_refused(model, options, message):
    with pytest.raises(UsageError, match=message):
        build_unknowns(model, ConsistentOptions(**options))


@pytest.mark.parametrize(
    "options",
    [
        {"friction": "slippery"},
        {"weighting": "heavy"},
        {"com": "inside"},
        {"prior_weight": 0.0},
        {"total_mass": (3.0, 0.0)},
        {"priors": {"P_d1": (1.0, 0.0)}},
        {"speed": {"joint1": -1.0}},
    ],
)
def test_options_without_a_meaning_are_refused(options):
    with pytest.raises(UsageError):
        ConsistentOptions(**options)
