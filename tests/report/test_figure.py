"""The picture of measured, predicted and residual torque."""

from __future__ import annotations

from pathlib import Path

from matplotlib import image

from scara_ident.report.figure import MOST_RECORDINGS, torque_figure
from tests.report.simulated import made, run


def test_a_picture_is_drawn_with_held_out_runs_first(tmp_path: Path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    titles: list[str] = []
    original = Figure.savefig

    def spy(self: Figure, *args, **kwargs):
        titles.extend(axis.get_title() for axis in self.axes[:MOST_RECORDINGS])
        return original(self, *args, **kwargs)

    monkeypatch.setattr(Figure, "savefig", spy)
    fit, held = run("OJD_1", 1, seconds=6.0), run("CI_1", 2, seconds=6.0)
    torque_figure(tmp_path / "torque.png", made([fit], [held]), [fit, held])
    assert titles[:2] == ["CI_1 (held out)", "OJD_1 (fitted)"]
    height, width, _ = image.imread(tmp_path / "torque.png").shape
    assert height > 300
    assert width > 600


def test_a_joint_at_rest_is_drawn_too(tmp_path: Path):
    fit = run("OJD_1", 1, still=True, seconds=6.0)
    torque_figure(tmp_path / "torque.png", made([fit]), [fit])
    assert (tmp_path / "torque.png").stat().st_size > 5000
