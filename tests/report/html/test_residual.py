"""The residual over signals, frequency, motor angle and lag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.report.html.blocks import Group, Paragraph
from scara_ident.report.html.residual import residual_blocks, scatter
from scara_ident.report.plot import Band, Density, Line
from scara_ident.robot.robot import load_robot
from tests.report.simulated import RATE, swinging, trace_of

ROBOT = load_robot()
BANDS = (15.0, None)


def layers(drawing, kind) -> list:
    return [layer for layer in drawing.panels[0].layers if isinstance(layer, kind)]


def figures(blocks) -> dict:
    return {figure.name: figure for block in blocks if isinstance(block, Group) for figure in block.figures}


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((2, 20000))


def test_means_lie_on_the_function_within_their_errors_and_every_sample_is_counted():
    random = np.random.default_rng(0)
    x = random.uniform(-1.0, 1.0, 20000)
    y = 2.0 * x + 0.1 * random.standard_normal(20000)
    plot = scatter(x, y, "x [rad]", "N m")
    (line,), (band,), (density,) = (layers(plot, kind) for kind in (Line, Band, Density))
    assert np.max(np.abs(line.y - 2.0 * line.x)) < 0.02
    np.testing.assert_allclose(0.5 * (np.asarray(band.low) + band.high), line.y, atol=1e-12)
    assert density.counts.sum() == pytest.approx(20000, rel=0.02)
    assert plot.panels[0].label == "residual [N m]"


def test_a_residual_that_repeats_with_the_motor_is_seen_at_its_order_and_at_its_frequency():
    motion = swinging(noise())
    ripple = 0.1 * noise() + np.array([[1.0], [0.0]]) * np.sin(300.0 * motion.q[0])
    found = figures(residual_blocks(ROBOT, {"fitted": [trace_of(swinging(ripple))]}, BANDS))
    (line,) = [line for line in layers(found["order"].variants[0, 0], Line) if line.name == "residual"]
    assert np.asarray(line.x)[np.argmax(line.y)] == pytest.approx(3.0, abs=0.05)
    time = np.arange(20000) / RATE
    humming = 0.1 * noise() + np.sin(2.0 * np.pi * 20.0 * time)
    found = figures(residual_blocks(ROBOT, {"fitted": [trace_of(swinging(humming))]}, BANDS))
    (line,) = [line for line in layers(found["frequency"].variants[1, 0], Line) if line.name == "recorded torque"]
    assert np.asarray(line.x)[np.argmax(line.y)] == pytest.approx(20.0, rel=0.1)


def test_white_noise_stays_within_the_bounds_of_its_autocorrelation():
    found = figures(residual_blocks(ROBOT, {"fitted": [trace_of(swinging(noise(3)))]}, BANDS))
    plot = found["lag"].variants[0, 0]
    (line,) = layers(plot, Line)
    bound = max(layer.y for layer in plot.panels[0].layers if not isinstance(layer, Line))
    assert np.mean(np.abs(line.y) <= bound) > 0.85


def test_sets_without_recordings_are_left_out():
    sets = {"fitted": [trace_of(swinging(noise()))], "held out": []}
    blocks = residual_blocks(ROBOT, sets, BANDS)
    found = figures(blocks)
    assert {key[1] for figure in found.values() for key in figure.variants} == {0}
    (group,) = {tuple(s.options) for b in blocks if isinstance(b, Group) for s in b.selectors[1:2]}
    assert group == ("fitted",)


def test_a_motor_that_never_makes_a_turn_has_no_figure_over_its_angle():
    slow = replace(ROBOT, reduction=np.array([1.0, 100.0]))
    blocks = residual_blocks(slow, {"fitted": [trace_of(swinging(noise()))]}, BANDS)
    assert {key[2] for key in figures(blocks)["against-motor"].variants} == {1}
    assert any("No figure over the motor angle of joint1:" in b.text for b in blocks if isinstance(b, Paragraph))
