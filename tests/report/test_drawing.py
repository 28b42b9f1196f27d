"""Still pictures show what they are given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.report.drawing import draw, drawn
from scara_ident.report.plot import Figure, Grid, Level, Line, Matrix, Panel, Plot, single
from tests.report.pixels import share


def line(*layers, **options) -> Figure:
    return single("name", "title", "", Plot("time [s]", (Panel("torque [N m]", layers, **options),)))


@pytest.mark.slow
def test_a_peak_of_one_sample_in_a_hundred_thousand_is_drawn(tmp_path: Path):
    signal = np.zeros(100_000)
    flat = line(Line(Grid(0.0, 1.0, len(signal)), signal.copy(), "blue"), limits=(-1.0, 1.0))
    signal[61_234] = 1.0
    peak = line(Line(Grid(0.0, 1.0, len(signal)), signal, "blue"), limits=(-1.0, 1.0))
    draw(tmp_path / "flat.png", "", [[flat]])
    draw(tmp_path / "peak.png", "", [[peak]])
    assert share(tmp_path / "peak.png", "blue") > share(tmp_path / "flat.png", "blue") + 1e-4


def test_what_is_not_to_be_fitted_does_not_widen_the_axis(tmp_path: Path):
    x = np.linspace(0.0, 1.0, 50)
    small = Line(x, np.sin(9.0 * x), "blue", width=3.0)
    far = Level(1e6, "vermillion", fit=False)
    draw(tmp_path / "alone.png", "", [[line(small)]])
    draw(tmp_path / "beside.png", "", [[line(small, far)]])
    assert share(tmp_path / "beside.png", "blue") == pytest.approx(share(tmp_path / "alone.png", "blue"), rel=0.01)
    assert share(tmp_path / "beside.png", "vermillion") == 0.0


def test_a_matrix_has_the_colour_of_its_signs(tmp_path: Path):
    def colours(values: list[list[float]]) -> tuple[float, float]:
        matrix = single("m", "", "", Matrix(["a"], ["b", "c"], np.array(values)))
        draw(tmp_path / "m.png", "", [[matrix]])
        return share(tmp_path / "m.png", "blue"), share(tmp_path / "m.png", "vermillion")

    bar = colours([[0.0, 0.0]])
    both, up = colours([[1.0, -1.0]]), colours([[1.0, 1.0]])
    assert up[0] > both[0] > bar[0]
    assert both[1] > up[1]


def test_a_row_tells_its_names_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from matplotlib.figure import Figure as Canvas

    told: list[list[str]] = []
    original = Canvas.legend
    monkeypatch.setattr(Canvas, "legend", lambda self, handles, names, **rest: (told.append(list(names)), original(self, handles, names, **rest))[1])  # fmt: skip
    one = line(Line([0.0, 1.0], [0.0, 1.0], "blue", "measured"))
    two = line(Line([0.0, 1.0], [0.0, 1.0], "blue", "measured"), Line([0.0, 1.0], [1.0, 0.0], "green", "predicted"))
    draw(tmp_path / "a.png", "", [[one, one], [one], [two], []])
    assert told == [["measured"], ["measured", "predicted"]]


def test_a_picture_that_cannot_be_written_is_one_line_and_leaves_nothing(tmp_path: Path):
    with pytest.raises(ScaraIdentError, match=r"a\.docx: cannot be written: ") as caught:
        draw(tmp_path / "a.docx", "", [[line(Line([0.0, 1.0], [0.0, 1.0], "blue"))]])
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_equal_scales_are_drawn_without_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    wide = Plot("x [m]", (Panel("y [m]", (Line([0.0, 9.0], [0.0, 1.0], "blue"),), limits=(-1.0, 1.0)),), equal=True)
    draw(tmp_path / "equal.png", "", [[single("name", "title", "", wide)]])
    assert caplog.text == ""


def test_a_picture_in_the_hand_is_that_of_its_file(tmp_path: Path):
    figure = line(Line(np.linspace(0.0, 1.0, 50), np.linspace(-1.0, 1.0, 50), "blue"))
    draw(tmp_path / "a.png", "title", [[figure]])
    assert drawn("title", [[figure]]) == (tmp_path / "a.png").read_bytes()
