"""Matrices as columns."""

from __future__ import annotations

from tests.recording.files.formats import (
    write_mat,
)
from tests.recording.files.made import MADE, described, stacked
from tests.recording.made import refusal


def test_columns_of_different_lengths_are_refused_by_both(tmp_path):
    path = write_mat(tmp_path / "a.mat", {"t": MADE["time"], "q": stacked("position"), "tau": stacked("effort")[:, 1:]})
    robot = described(
        tmp_path, "{time: {column: t}, position: {column: 'q[{index}]'}, effort: {column: 'tau[{index}]'}}"
    )
    message = refusal(path, robot)
    assert "400" in message
    assert "399" in message
