"""What terms say of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from scara_ident.model.model import build_model
from scara_ident.model.terms import Friction, Offset
from scara_ident.model.terms.constraints import BrakingPolynomial, Nonnegative, RealBodies, constraints_of
from scara_ident.model.terms.term import Column, Filled
from scara_ident.robot.robot import load_robot
from tests.arms import motion

ROBOT = load_robot()


@dataclass(frozen=True, eq=False)
class Plain(Filled):
    """A term of which only marks on its columns are known."""

    marks: tuple[bool, ...]
    name: str = "plain"

    @property
    def columns(self) -> tuple[Column, ...]:
        return tuple(Column(f"c{k}", None, "N m", "", nonnegative=mark) for k, mark in enumerate(self.marks))


@pytest.mark.parametrize(
    ("marks", "expected"),
    [((), ()), ((False, False), ()), ((False, True, True), (Nonnegative((1, 2)),)), ((True,), (Nonnegative((0,)),))],
)
def test_marked_columns_of_a_term_without_constraints_cannot_be_negative(marks, expected):
    assert constraints_of(Plain(marks)) == expected


def test_a_terms_own_constraints_stand_for_the_marks_on_its_columns():
    kinds = {term.name: [type(each) for each in constraints_of(term)] for term in build_model(ROBOT).terms}
    assert kinds == {"rigid_body": [RealBodies], "friction": [BrakingPolynomial] * 2, "offset": []}
    assert constraints_of(Offset(ROBOT)) == ()


@pytest.mark.parametrize("powers", [(0, 1), (0, 1, 2, 3), (1, 3)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_polynomial_that_is_bounded_is_the_friction_that_is_fitted(powers: tuple[int, ...], sign: float):
    """At every speed up to the limit, in both directions, whichever way the gear turns."""
    robot = replace(ROBOT, reduction=np.array([sign * 100.0, 80.0]))
    term = Friction(robot, powers)
    value = np.random.default_rng(1).normal(size=2 * len(powers))
    for joint, bounded in enumerate(constraints_of(term)):
        assert isinstance(bounded, BrakingPolynomial)
        assert (bounded.joint, bounded.powers) == (robot.joints[joint], powers)
        assert (bounded.speed, bounded.limit) == (robot.velocity_limit[joint], robot.torque_limit[joint])
        speed = np.linspace(0.1, bounded.speed, 7)
        polynomial = value[list(bounded.columns)] @ speed ** np.array(bounded.powers)[:, None]
        for way in (1.0, -1.0):
            v = np.zeros((2, 7))
            v[joint] = way * speed
            torque = np.einsum("jpn,p->jn", term.regressor(motion(0 * v, v, 0 * v)), value)[joint]
            np.testing.assert_allclose(torque, way * robot.drive_sign[joint] * polynomial, rtol=1e-12)
