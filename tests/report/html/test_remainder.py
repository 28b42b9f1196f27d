"""What is left, over one signal and over two."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.evidence.outcome import Unexplained
from scara_ident.report.html.remainder import PAIR_BINS, remainder_group, signal_of
from scara_ident.report.plot import Line, Matrix
from scara_ident.robot.robot import load_robot
from tests.report.simulated import swinging, trace_of

ROBOT = load_robot()


def left(function) -> list:
    """Traces of joint 2 with a residual that is a function of the motion, and a little noise."""
    motion = swinging(np.zeros((2, 20000)))
    torque = 0.01 * np.random.default_rng(0).standard_normal((2, 20000))
    torque[1] += function(motion)
    return [trace_of(swinging(torque))]


def test_over_a_signal_the_means_are_the_function():
    remainder = Unexplained("joint2", ("velocity of joint1",), 0.1, 0.9)
    group = remainder_group(ROBOT, remainder, left(lambda motion: 0.3 * motion.v[0]))
    (figure,) = group.figures
    plot = figure.variants[()]
    assert plot.x_label == "velocity of joint1 [rad/s]"
    (line,) = [layer for layer in plot.panels[0].layers if isinstance(layer, Line)]
    shown = np.isfinite(line.y)
    assert np.count_nonzero(shown) > 20
    np.testing.assert_allclose(np.asarray(line.y)[shown], 0.3 * np.asarray(line.x)[shown], atol=0.01)


def test_over_two_signals_the_first_row_is_the_top():
    remainder = Unexplained("joint2", ("position of joint1", "position of joint2"), 0.1, 0.9)
    group = remainder_group(ROBOT, remainder, left(lambda motion: motion.q[0] + 3.0 * motion.q[1]))
    matrix = group.figures[-1].variants[()]
    assert isinstance(matrix, Matrix)
    assert (matrix.column_label, matrix.row_label) == ("position of joint1 [rad]", "position of joint2 [rad]")
    across, down = np.array(matrix.columns, dtype=float), np.array(matrix.rows, dtype=float)
    assert np.all(np.diff(across) > 0.0)
    assert np.all(np.diff(down) < 0.0)
    expected = across + 3.0 * down[:, None]
    shown = np.isfinite(matrix.values)
    assert np.count_nonzero(shown) > 0.75 * PAIR_BINS**2
    # A bin is a twelfth of two radians wide, within which samples are not spread evenly.
    np.testing.assert_allclose(matrix.values[shown], expected[shown], atol=0.35)
    assert matrix.most == pytest.approx(np.nanmax(np.abs(matrix.values)))


def test_a_signal_that_is_not_known_has_no_figure():
    traces = left(lambda motion: motion.q[0])
    assert remainder_group(ROBOT, Unexplained("joint2", (), 0.1, 0.9), traces) is None
    assert remainder_group(ROBOT, Unexplained("joint2", ("phase of the moon",), 0.1, 0.9), traces) is None
    assert signal_of(ROBOT, "position of joint9", 0) is None


def test_the_motor_angle_is_the_joints_times_the_reduction_within_a_turn():
    (trace,) = left(lambda motion: 0.0)
    signal, unit = signal_of(ROBOT, "motor angle", 1)
    turn = np.exp(1j * signal(trace))
    np.testing.assert_allclose(turn, np.exp(100j * trace.motion.q[1]), atol=1e-9)
    assert unit == "rad"
