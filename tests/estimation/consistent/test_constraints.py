from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.bodies import pack
from scara_ident.estimation.consistent.constraints import Cone, Statement, active_set, body_limits
from scara_ident.estimation.consistent.options import ConsistentOptions, Ellipsoid
from scara_ident.robot.robot import load_robot

# The unknowns are the entries of the cones themselves: a number, a ball, a matrix of 2x2 and one of 3x3.
PLACES = [range(1), range(1, 5), range(5, 8), range(8, 14)]
SIZE = 14
KINDS = ("nonnegative", "ball", "semidefinite", "semidefinite")
CONES = [
    Cone(kind, np.eye(SIZE)[list(place)], np.zeros(len(place)), f"{kind} {len(place)}")
    for kind, place in zip(KINDS, PLACES, strict=True)
]
OUTSIDE = np.concatenate(
    [[-1.0], [1.0, 3.0, 0.0, 4.0], pack(np.array([[1.0, 2.0], [2.0, 1.0]])), pack(np.diag([1.0, -2.0, 3.0]))]
)
NEAREST = np.concatenate([[0.0], [3.0, 1.8, 0.0, 2.4], pack(np.full((2, 2), 1.5)), pack(np.diag([1.0, 0.0, 3.0]))])


def projection() -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """The point of all cones nearest to one outside, and the multipliers."""
    import cvxpy as cp

    x = cp.Variable(SIZE)
    statement = Statement(CONES, x)
    cp.Problem(cp.Minimize(0.5 * cp.sum_squares(x - OUTSIDE)), statement.constraints).solve(cp.CLARABEL)
    return x.value, statement.multipliers()


def test_cvxpy_projects_on_the_cones_and_the_multipliers_are_the_way_to_them():
    x, multipliers = projection()
    np.testing.assert_allclose(x, NEAREST, atol=1e-6)
    # At the nearest point the gradient is a sum of multipliers; with identity rows each is the step itself.
    np.testing.assert_allclose(np.concatenate(multipliers), NEAREST - OUTSIDE, atol=1e-6)


def test_margins_are_distances_along_the_identity():
    assert [cone.margin(OUTSIDE) for cone in CONES] == pytest.approx([-1.0, -4.0, -1.0, -2.0])
    for cone in CONES:
        assert cone.inside(0.3).margin(OUTSIDE) == pytest.approx(cone.margin(OUTSIDE) - 0.3)


def test_what_holds_a_solution_is_named_and_its_directions_are_forbidden():
    x, multipliers = projection()
    rows, labels = active_set(CONES, x, multipliers)
    assert labels == tuple(cone.label for cone in CONES)
    assert rows.shape == (4, SIZE)
    # Each forbidden direction is the one in which the projection moved.
    for row, multiplier, place in zip(rows, multipliers, PLACES, strict=True):
        direction = row[list(place)] / np.linalg.norm(row)
        assert abs(direction @ multiplier) == pytest.approx(np.linalg.norm(multiplier), rel=1e-5)
    inside = np.concatenate([cone.identity for cone in CONES])
    assert active_set(CONES, inside, [np.zeros(len(p)) for p in PLACES])[1] == ()


def test_limits_hold_for_an_arm_within_them_and_not_for_one_without():
    robot = load_robot()
    standard = robot.standard_parameters()
    mass, centre = standard[0], standard[1:4] / standard[0]
    link = robot.links[0]

    def margin(**options) -> float:
        limits = body_limits(robot, ConsistentOptions(**options))
        assert limits
        return min(limit.margin(standard) for limit in limits)

    assert margin(link_mass={link: (mass + 0.5, 1.0)}) == pytest.approx(0.5)
    assert margin(link_mass={robot.joints[0]: (mass + 2.0, 1.0)}) == pytest.approx(-1.0)
    assert margin(total_mass=(standard[0] + standard[10] + 1.5, 1.0)) == pytest.approx(-0.5)
    inside = Ellipsoid(tuple(centre + np.array([0.01, 0.0, 0.0])), (0.02, 0.02, 0.02))
    assert margin(com={link: inside}) == pytest.approx(0.5 * mass)
    assert margin(com={link: Ellipsoid(tuple(centre + np.array([0.0, 0.03, 0.0])), (0.02, 0.02, 0.02))}) < 0.0
    assert margin(com="visual") > 0.0
    assert body_limits(robot, ConsistentOptions()) == ()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"link_mass": {"nose": (1.0, 0.1)}}, "neither an identified link nor joint"),
        ({"com": {"link1": Ellipsoid((0, 0, 0), (0.1, 0.0, 0.1))}}, "radius"),
    ],
)
def test_limits_on_what_does_not_exist_are_refused(options, message):
    with pytest.raises(UsageError, match=message):
        body_limits(load_robot(), ConsistentOptions(**options))
