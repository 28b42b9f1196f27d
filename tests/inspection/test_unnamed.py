"""Columns without names are told by their places."""

from __future__ import annotations

import numpy as np

from scara_ident.inspection.unnamed import meanings_by_place
from tests.inspection.made import MADE
from tests.recording.files.formats import JOINTS


def table(*signals: str) -> dict[str, np.ndarray]:
    rows = [MADE["time"], *(MADE[f"{joint}.{signal}"] for signal in signals for joint in JOINTS)]
    return {f"column_{k + 1}": row for k, row in enumerate(rows)}


def told(columns: dict[str, np.ndarray], counts: tuple[int, ...] = (3, 2)) -> list[str]:
    return [f"{said.quantity} {said.number}" for said in meanings_by_place(columns, counts).values()]


def test_two_blocks_are_positions_and_efforts():
    assert told(table("position", "effort")) == ["time None", "position 1", "position 2", "effort 1", "effort 2"]


def test_of_three_the_second_has_to_be_the_slope_of_the_first():
    assert told(table("position", "velocity", "effort"))[3:5] == ["velocity 1", "velocity 2"]
    assert told(table("velocity", "position", "effort"), (2,)) == []


def test_other_numbers_of_columns_say_nothing():
    columns = table("position", "effort")
    assert told(columns, (3,)) == []
    assert told({"column_0": np.zeros(600)} | columns) == []
