"""The tables as typed."""

from __future__ import annotations

import json

import pytest

from scara_ident import paper
from tests.paper.made import NAMES
from tests.shared import shared_path


def test_tables_are_typed_as_printed() -> None:
    printed = json.loads(shared_path("paper", "tables.json").read_text(encoding="utf-8"))
    assert tuple(printed["trajectories"]) == paper.TRAJECTORIES

    def row(values: dict[str, float]) -> tuple[float, ...]:
        return tuple(values[name] for name in paper.TRAJECTORIES)

    first = printed["table1"]
    assert paper.TABLE_1.log_det == row(first["J_d"])
    assert paper.TABLE_1.condition == row(first["J_k"])
    for key in ("sigma", "peak_velocity", "peak_acceleration"):
        assert getattr(paper.TABLE_1, key) == (row(first[f"{key}_1"]), row(first[f"{key}_2"]))
    for table, key in (
        (paper.TABLE_2, "table2_complete_model_rms_error"),
        (paper.TABLE_3, "table3_complete_model_normalised"),
        (paper.TABLE_4, "table4_reduced_model_rms_error"),
    ):
        for joint, number in enumerate("12"):
            cells = printed[key][number]
            assert table.errors[joint] == tuple(row(cells[name]) for name in paper.TRAJECTORIES)
            assert table.row_average[joint] == tuple(cells[name]["average"] for name in paper.TRAJECTORIES)
            if "torque_rms" in cells["CI"]:
                assert paper.TORQUE_RMS[joint] == tuple(cells[n]["torque_rms"] for n in paper.TRAJECTORIES)
    fifth = printed["table5_reduced_model_parameters"]
    assert tuple(fifth) == paper.REDUCED
    assert tuple(row(values) for values in fifth.values()) == paper.TABLE_5


def test_a_column_of_table_5_becomes_a_parameter_vector() -> None:
    found = dict(zip(NAMES, paper.table5_parameters("L2"), strict=True))
    assert found["P_d4"] == -3.554
    assert found["a22"] == -0.034
    assert all(found[name] == 0.0 for name in set(NAMES) - set(paper.REDUCED))
    with pytest.raises(ValueError, match="L3"):
        paper.table5_parameters("L3")
