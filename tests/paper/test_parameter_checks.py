"""Whether an arm can have the parameters of Table 5."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident import paper
from scara_ident.paper import parameter_checks
from tests.paper.made import friction


def test_no_arm_has_the_parameters_of_CI_and_L2(report: paper.PaperReport) -> None:
    impossible = {
        c.trajectory
        for c in report.section("Table 5, inertia")
        if c.quantity.startswith("an arm exists") and not c.agrees
    }
    assert impossible == {"CI", "L2"}


@pytest.mark.parametrize("trajectory", paper.TRAJECTORIES)
def test_the_arm_that_is_said_to_exist_can_be_built(trajectory: str, report: paper.PaperReport) -> None:
    """Independent of the bound: look for a mass of link 2 with which both bodies are possible."""
    d1, d2, _, d4, d5 = paper.table5_parameters(trajectory)[:5]
    masses = np.geomspace(1e-2, 1e3, 20001)
    link2 = d4 - d2**2 / masses >= 0.0
    link1 = d1 - masses * paper.LINK_LENGTH**2 >= 0.0
    possible = bool(np.any(link1 & link2)) and d5 >= 0.0
    (row,) = [
        c
        for c in report.section("Table 5, inertia")
        if c.quantity.startswith("an arm exists") and c.trajectory == trajectory
    ]
    assert row.agrees == possible


def test_friction_is_never_negative_where_it_was_measured_and_four_times_beyond(
    report: paper.PaperReport,
) -> None:
    section = report.section("Table 5, friction")
    assert all(c.agrees for c in section if "estimated from" in c.quantity)
    driving = {(c.trajectory, c.joint) for c in section if "can reach" in c.quantity and not c.agrees}
    assert driving == {("CI", "joint1"), ("L2", "joint1"), ("L2", "joint2"), ("OJK", "joint1")}


@settings(max_examples=60)
@given(
    coefficients=st.tuples(*[st.floats(-1, 1)] * 4),
    top=st.floats(0.1, 5.0),
)
def test_least_friction_is_that_of_a_fine_grid(coefficients: tuple[float, float, float, float], top: float) -> None:
    speeds = np.linspace(0.0, top, 20001)[1:]
    torque = friction(speeds, coefficients)
    least, zero = parameter_checks.min_friction(np.array(coefficients), top)
    # Between grid points the torque moves by less than this.
    spacing = (1.0 + 2.0 * top + 3.0 * top**2) * top / 20000
    on_grid = min(torque.min(), coefficients[0])
    assert on_grid - spacing <= least <= on_grid + 1e-12
    assert (zero is None) == (least >= 0.0)
    if zero is not None:
        assert torque[speeds < zero].min(initial=0.0) >= -1e-12
        # The crossing is a root to rounding, of terms of up to this size.
        size = float(np.abs(coefficients) @ zero ** np.arange(4))
        assert friction(zero, coefficients) <= 8.0 * np.finfo(float).eps * size


def test_friction_that_only_grazes_zero_does_not_drive() -> None:
    grazing = np.array([1.0, -2.0, 1.0, 0.0])  # (1 - v)^2
    assert parameter_checks.min_friction(grazing, 3.0) == (0.0, None)
    through = np.array([1.0, -1.0, 0.0, 0.0])
    least, zero = parameter_checks.min_friction(through, 3.0)
    assert least == -2.0
    assert zero == pytest.approx(1.0, rel=1e-14)
