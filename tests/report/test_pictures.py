"""The pictures beside the reports: which there are, and that they show what they should."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects.position import Spring
from scara_ident.errors import ScaraIdentError
from scara_ident.excitation import Effort, design_excitation
from scara_ident.model.model import build_model
from scara_ident.report.diagnosis_markdown import diagnosis_markdown
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.report.html.identification import IdentificationContext
from scara_ident.report.html.remainder import signal_of
from scara_ident.report.pictures import (
    MAX_RECORDINGS,
    design_figures,
    design_picture,
    diagnosis_pictures,
    path_views,
    remove_stale,
    torque_picture,
)
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque
from tests.report.pixels import share
from tests.report.simulated import made, run


@pytest.fixture(scope="module")
def with_spring():
    runs = with_torque(exact_runs(3)[:4], 1, lambda motion: 0.05 * motion.q[1])
    return runs, diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),))


@pytest.fixture(scope="module")
def with_remainder():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    return runs, diagnose(load_robot(), runs, bands=BANDS, catalogue=())


@pytest.mark.slow
def test_an_effect_is_drawn_before_and_after_and_stands_in_the_story(with_spring, tmp_path):
    _, found = with_spring
    (picture,) = diagnosis_pictures(DiagnosisContext(found))
    assert (picture.title, picture.name) == ("spring on joint2", "effect_1.png")
    (tmp_path / picture.name).write_bytes(picture.content)
    # Before, after, and what is measured of the effect; a stroke of the legend alone has not half as many pixels.
    for color in ("vermillion", "blue", "green"):
        assert share(tmp_path / "effect_1.png", color) > 2e-4
    text = diagnosis_markdown(found, [(picture.title, picture.name)])
    assert "![spring on joint2](effect_1.png)" in text
    assert "png" not in diagnosis_markdown(found)


def test_a_remainder_is_drawn_over_what_it_depends_on(with_remainder, tmp_path):
    _, found = with_remainder
    (picture,) = diagnosis_pictures(DiagnosisContext(found))
    assert (picture.title, picture.name) == ("What no effect explains on joint2", "unexplained.png")
    (tmp_path / picture.name).write_bytes(picture.content)
    assert share(tmp_path / "unexplained.png", "vermillion") > 2e-4
    diagnosis_report(tmp_path / "report.html", DiagnosisContext(found))
    assert 'data-figure="remainder-0"' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_every_signal_that_the_screening_names_can_be_drawn(with_remainder):
    _, found = with_remainder
    names = {name for item in found.dependences for name in item.signals}
    assert len(names) >= 8
    assert [name for name in sorted(names) if signal_of(found.robot, name, 1) is None] == []


def test_pictures_of_an_earlier_diagnosis_do_not_stay(tmp_path: Path) -> None:
    for name in ("effect_1.png", "effect_2.png", "unexplained.png", "mine.png"):
        (tmp_path / name).write_bytes(b"png")
    remove_stale(tmp_path, ["effect_1.png"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["effect_1.png", "mine.png"]


@pytest.mark.slow
def test_held_out_runs_are_drawn_first_and_not_too_many(tmp_path: Path, monkeypatch):
    from matplotlib.figure import Figure

    said: list[str] = []
    original = Figure.savefig

    def spy(self: Figure, *args, **kwargs):
        said.extend(text.get_text() for text in self.texts)
        return original(self, *args, **kwargs)

    monkeypatch.setattr(Figure, "savefig", spy)
    fit, held = [run(f"OJD_{k}", k, seconds=6.0) for k in range(1, 5)], [run("CI_1", 9, seconds=6.0)]
    torque_picture(tmp_path / "torque.png", IdentificationContext(made(fit, held)))
    assert said[1:3] == ["CI_1 (held out), joint1", "OJD_1 (fitted), joint1"]
    assert sum("joint2" in text for text in said) == MAX_RECORDINGS
    for color in ("blue", "vermillion", "green"):
        assert share(tmp_path / "torque.png", color) > 2e-4


def test_a_joint_at_rest_is_drawn_too(tmp_path: Path):
    fit = [run("OJD_1", 1, still=True, seconds=6.0)]
    torque_picture(tmp_path / "torque.png", IdentificationContext(made(fit)))
    assert share(tmp_path / "torque.png", "blue") > 2e-4


@pytest.mark.slow
def test_a_design_is_a_picture(tmp_path: Path):
    effort = Effort(starts=1, rounds=0, processes=1)
    design = design_excitation(
        build_model(load_robot()), duration=4.0, harmonics=5, samples=120, trajectories=2, effort=effort
    )
    (motion, _), *_ = design_figures(design)[1]
    # No joint of this arm slides.
    assert [panel.label for drawing in motion.variants.values() for panel in drawing.panels] == ["position [rad]"]
    design_picture(tmp_path / "new" / "preview.png", design)
    for color in ("blue", "vermillion", "sky"):
        assert share(tmp_path / "new" / "preview.png", color) > 2e-4
    with pytest.raises(ScaraIdentError, match="cannot be written"):
        design_picture(tmp_path / "preview.docx", design)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_a_path_in_a_plane_has_one_view_and_one_in_space_two():
    """A circle in the plane x, z, and the same one tilted out of it."""
    angle = np.linspace(0.0, 6.0, 50)
    flat = np.array([np.cos(angle), np.full(50, 0.3), np.sin(angle)])
    deep = flat + np.array([[0.0], [0.5], [0.0]]) * np.cos(angle)
    assert [view.name for view in path_views([flat], "tool0")] == ["path-02"]
    above, side = path_views([deep], "tool0")
    assert (above.title, side.title) == (
        "Path of tool0 from above (dot: start)",
        "Path of tool0 from the side (dot: start)",
    )
    panel = side.variants[()].panels[0]
    assert panel.label == "z [m]"
    np.testing.assert_array_equal(panel.layers[0].x, deep[0])
