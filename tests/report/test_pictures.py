"""The figures beside the Markdown of a diagnosis: which there are, and that they show what they should."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects import View
from scara_ident.effects.position import Spring
from scara_ident.motion.motion import Motion
from scara_ident.report.diagnosis import diagnosis_markdown
from scara_ident.report.html import diagnosis_report
from scara_ident.report.html.chapters import Chapter
from scara_ident.report.html.remainder import signal_of
from scara_ident.report.html.story import SIGNALS, chapter_group
from scara_ident.report.html.torque import torque_group
from scara_ident.report.html.traces import Trace
from scara_ident.report.pictures import COLORS, diagnosis_pictures, remove_stale
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque


def _share(path: Path, color: str) -> float:
    """Return the share of a picture's pixels that have a colour."""
    from matplotlib.image import imread

    wanted = np.array([int(COLORS[color][k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
    return float(np.mean(np.all(np.abs(imread(path)[..., :3] - wanted) < 0.02, axis=-1)))


@pytest.fixture(scope="module")
def with_spring():
    runs = with_torque(exact_runs(3)[:4], 1, lambda motion: 0.05 * motion.q[1])
    return runs, diagnose(load_robot(), "complete", runs, bands=BANDS, catalogue=(Spring(),))


@pytest.fixture(scope="module")
def with_remainder():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    return runs, diagnose(load_robot(), "complete", runs, bands=BANDS, catalogue=())


def test_an_effect_is_drawn_before_and_after_and_stands_in_the_story(with_spring, tmp_path):
    runs, found = with_spring
    pictures = diagnosis_pictures(tmp_path, found, runs)
    assert pictures == (("spring on joint2", "effect_1.png"),)
    assert [path.name for path in tmp_path.iterdir()] == ["effect_1.png"]
    # Before, after, and what is measured of the effect; a stroke of the legend alone has not half as many pixels.
    for color in ("vermillion", "blue", "green"):
        assert _share(tmp_path / "effect_1.png", color) > 2e-4
    text = diagnosis_markdown(found, pictures)
    assert "![spring on joint2](effect_1.png)" in text
    assert "png" not in diagnosis_markdown(found)


def test_a_remainder_is_drawn_over_what_it_depends_on(with_remainder, tmp_path):
    runs, found = with_remainder
    assert diagnosis_pictures(tmp_path, found, runs) == (("what no effect accounts for on joint2", "unexplained.png"),)
    assert _share(tmp_path / "unexplained.png", "vermillion") > 2e-4
    diagnosis_report(tmp_path / "report.html", found, runs)
    assert 'data-figure="remainder-0"' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_every_signal_that_the_screening_names_can_be_drawn(with_remainder):
    _, found = with_remainder
    names = {name for item in found.dependences for name in item.signals}
    assert len(names) >= 8
    assert [name for name in sorted(names) if signal_of(found.robot, name, 1) is None] == []


def _trace(residual: np.ndarray, used: np.ndarray) -> Trace:
    time = np.arange(residual.shape[1]) / 250.0
    omega = np.array([[0.7], [0.9]])
    q, v = np.sin(omega * time), omega * np.cos(omega * time)
    motion = Motion("X", "X", time, q, v, -(omega**2) * q, residual, 250.0)
    zero = np.zeros_like(q)
    return Trace("X", 0.0, motion, residual, zero, zero, zero, zero, used, (1, 1), 1)


def test_after_a_reversal_the_distance_over_which_the_effect_acts_is_shown():
    residual = np.random.default_rng(0).standard_normal((2, 20000))
    trace = _trace(residual, np.ones(residual.shape, dtype=bool))
    for distance in (0.02, 1e-6):
        view = View("reversal", along=True)
        chapter = Chapter(1, "presliding", 0, [trace], [trace], BANDS, "joint1", view, distance=distance)
        plot = chapter_group(load_robot(), chapter).figures[0].variants[()]
        low, high = plot.limits
        assert low == 0.0
        assert 4.0 * distance < high < 0.5
        # However short the distance, there is something to see.
        assert np.any(np.isfinite(plot.panels[-1].layers[1].y))


@pytest.mark.parametrize("signal", [*SIGNALS, "own", "order", "frequency"])
def test_every_view_has_a_figure_and_an_effect_that_names_none_is_shown_over_its_own_torque(signal: str):
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2, 20000))
    before = _trace(noise, np.ones(noise.shape, dtype=bool))
    after = replace(before, predicted=0.1 * rng.standard_normal(noise.shape))
    chapter = Chapter(1, "mine", 0, [before], [after], BANDS, "joint1", View(signal))
    names = [figure.name for figure in chapter_group(load_robot(), chapter).figures]
    assert names == ([] if signal == "own" else ["effect-1-view"]) + ["effect-1-own"]


def test_a_residual_that_is_not_used_does_not_set_the_scale():
    residual = np.full((2, 4000), 0.01)
    residual[:, 1000:1500] = 5.0
    used = residual < 1.0
    group = torque_group(load_robot(), [("X", [_trace(residual, used)])], (None, None))
    layers = {layer.name: layer for layer in group.figures[0].variants[0, 0].panels[1].layers}
    assert not layers["residual, not used"].fit
    assert np.nanmax(layers["residual"].y) == pytest.approx(0.01)
    assert np.nanmax(layers["residual, not used"].y) == pytest.approx(5.0)


def test_pictures_of_an_earlier_diagnosis_do_not_stay(tmp_path: Path) -> None:
    for name in ("effect_1.png", "effect_2.png", "unexplained.png", "mine.png"):
        (tmp_path / name).write_bytes(b"png")
    remove_stale(tmp_path, ["effect_1.png"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["effect_1.png", "mine.png"]
