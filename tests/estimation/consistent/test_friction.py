from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.constraints import Cone
from scara_ident.estimation.consistent.friction import (
    as_recorded,
    certificate,
    friction_faults,
    negative_ranges,
    shape_faults,
    torque_unit,
)
from scara_ident.model.terms import BrakingPolynomial


def polynomial(speed: float, limit: float, powers: tuple[int, ...] = (0, 1, 2, 3)) -> BrakingPolynomial:
    return BrakingPolynomial("elbow", tuple(range(len(powers))), powers, speed, limit)


def slack(cones: tuple[Cone, ...], coefficients: np.ndarray, auxiliary: int) -> float:
    """Largest amount by which all cones can be fulfilled with some auxiliary unknowns."""
    import cvxpy as cp

    free, margin = cp.Variable(max(1, auxiliary)), cp.Variable()
    x = cp.hstack([coefficients, free]) if auxiliary else coefficients
    constraints = [margin <= 1.0]
    for cone in cones:
        value = cone.matrix @ x + cone.offset
        if cone.kind == "nonnegative":
            constraints.append(value >= margin)
        else:
            first, product, second = value[0], np.sqrt(2.0) * value[1], value[2]
            constraints.append(cp.norm(cp.hstack([first - second, product])) <= first + second - 2 * margin)
    problem = cp.Problem(cp.Maximize(margin), constraints)
    problem.solve(cp.CLARABEL)
    return float(margin.value)


def on_grid(p: BrakingPolynomial, values: np.ndarray, end: float) -> tuple[float, float]:
    v = np.linspace(0.0, end, 4001)
    f = sum(a * v**k for a, k in zip(values, p.powers, strict=True))
    return float(np.min(f)), float(np.max(f))


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 100_000), st.sampled_from([(0, 1), (0, 1, 2), (0, 1, 2, 3)]))
def test_the_certificate_says_what_a_fine_grid_says(seed, powers):
    rng = np.random.default_rng(seed)
    p = polynomial(speed=rng.uniform(0.5, 5.0), limit=rng.uniform(0.5, 20.0), powers=powers)
    c = certificate(p, "dissipative", margin=0.0)
    scaled = rng.standard_normal(len(powers)) * 0.6
    scaled[0] = rng.uniform(0.0, 0.8)
    values = scaled * c.unit
    low, high = on_grid(p, values, p.speed)
    room = min(low, p.limit - high) / p.limit
    found = slack(c.cones, scaled, c.auxiliary)
    if abs(room) > 1e-3:
        assert (found > 0.0) == (room > 0.0)
        assert (friction_faults(p, values) == ()) == (room > 0.0)


@settings(max_examples=15)
@given(st.integers(0, 100_000), st.sampled_from([(0, 1), (0, 1, 2), (0, 1, 2, 3)]))
def test_without_a_velocity_limit_friction_brakes_at_every_speed(seed, powers):
    rng = np.random.default_rng(seed)
    p = polynomial(speed=np.inf, limit=5.0, powers=powers)
    c = certificate(p, "dissipative", margin=0.0)
    values = rng.uniform(-1.0, 1.5, len(powers))
    low, _ = on_grid(p, values, 1e3)
    falls = values[-1] < 0.0
    if abs(low) > 1e-2 and abs(values[-1]) > 1e-2:
        assert (slack(c.cones, values / c.unit, c.auxiliary) > -1e-9) == (low > 0.0 and not falls)


@settings(max_examples=15)
@given(st.integers(0, 100_000))
def test_the_lubricated_shape_rises_ever_less(seed):
    rng = np.random.default_rng(seed)
    p = polynomial(speed=3.0, limit=2.0)
    c = certificate(p, "lubricated", margin=0.0)
    scaled = np.array([rng.uniform(0, 0.3), rng.uniform(0, 1), rng.uniform(-0.6, 0.1), rng.uniform(-0.1, 0.2)])
    v = np.linspace(0.0, 1.0, 2001)
    f = np.polynomial.polynomial.polyval(v, scaled)
    slope, bend = np.diff(f), np.diff(f, 2)
    room = min(float(np.min(slope)), -float(np.max(bend)) * 1e3, 1.0 - float(np.max(f)))
    if abs(room) > 1e-4:
        assert (slack(c.cones, scaled, c.auxiliary) > 0.0) == (room > 0.0)
        shape_is_right = float(np.min(slope)) > 0.0 and float(np.max(bend)) < 0.0
        assert (shape_faults(p, scaled * c.unit) == ()) == shape_is_right


def test_the_lubricated_shape_needs_a_velocity_limit():
    with pytest.raises(UsageError, match=r"elbow.*velocity limit"):
        certificate(polynomial(speed=np.inf, limit=1.0), "lubricated")


def test_faults_name_the_range_of_speed():
    # (v - 1)(v - 2) is negative between 1 and 2, and 2 at rest.
    p = polynomial(speed=3.0, limit=10.0)
    (fault,) = friction_faults(p, np.array([2.0, -3.0, 1.0, 0.0]))
    assert (fault.kind, fault.joint) == ("pushes", "elbow")
    assert (fault.start, fault.stop) == pytest.approx((1.0, 2.0))
    (fault,) = friction_faults(p, np.array([1.0, 4.0, 0.0, 0.0]))
    assert fault.kind == "exceeds"
    assert (fault.start, fault.stop) == pytest.approx((2.25, 3.0))


def test_a_polynomial_that_touches_zero_is_not_negative():
    assert negative_ranges(np.array([1.0, -2.0, 1.0, 0.0]), 3.0) == []
    assert negative_ranges(np.zeros(4), 3.0) == []


def test_without_a_velocity_limit_a_falling_law_pushes_in_the_end():
    (fault,) = friction_faults(polynomial(np.inf, np.inf), np.array([1.0, 0.0, 0.0, -1.0]))
    assert fault.start == pytest.approx(1.0)
    assert fault.stop == np.inf


def test_without_limits_units_are_the_speed_and_the_friction_of_the_recordings():
    v = np.linspace(-4.0, 4.0, 400)
    factor = np.column_stack([np.sign(v) * np.abs(v) ** k for k in range(4)])
    value = np.array([0.02, 0.01, 0.0, 0.0])
    endless = as_recorded(polynomial(np.inf, np.inf), factor, value)
    assert 2.0 < endless.usual_speed < 4.0
    assert endless.usual_torque == pytest.approx(0.01 * endless.usual_speed + 1.0 / 20.0)
    small = as_recorded(polynomial(np.inf, np.inf), 1e3 * factor, 1e-3 * value)
    assert (small.usual_speed, small.usual_torque) == pytest.approx((endless.usual_speed, 1e-3 * endless.usual_torque))
    # Of a joint that stood still nothing is known.
    assert as_recorded(polynomial(np.inf, np.inf), 0.0 * factor, value) == polynomial(np.inf, np.inf)


def test_friction_is_given_to_the_solver_in_its_usual_size_where_that_is_known():
    assert torque_unit(polynomial(2.0, 50.0)) == 50.0
    assert torque_unit(polynomial(2.0, np.inf)) == 1.0
    small = replace(polynomial(2.0, 50.0), usual_torque=0.01)
    assert torque_unit(small) == 0.01
    assert torque_unit(replace(small, limit=0.001)) == 0.001
    # The same friction is allowed, whatever it is told in.
    for each in (polynomial(2.0, 50.0), small):
        found = certificate(each, "dissipative", margin=0.0)
        for friction, possible in (
            ([0.02, 0.01, 0.0, 0.0], True),
            ([0.02, -0.02, 0.0, 0.0], False),
            ([51.0, 0, 0, 0], False),
        ):
            assert (slack(found.cones, np.array(friction) / found.unit, found.auxiliary) > -1e-7) == possible
