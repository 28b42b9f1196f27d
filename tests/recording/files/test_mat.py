"""MATLAB files give the recording that the contract's Parquet gives."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from scara_ident.recording.files import column_names, read_columns
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot
from tests.recording.files.formats import (
    DEGREE,
    write_mat,
    write_mat73,
)
from tests.recording.files.made import MADE, assert_same, described, expected, stacked
from tests.recording.made import refusal

ARRAYS = "{time: {column: log.t}, position: {column: 'log.q[{index}]', unit: deg}, \
effort: {column: 'log.tau[{index}]', unit: mN m}, velocity: {column: 'log.qd[{index}]', unit: deg/s}}"


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("across", [False, True])
def test_matrices_in_a_struct_of_a_mat_file_are_channels_whichever_axis_is_time(tmp_path, version, across):
    log = {
        "t": MADE["time"][None],
        "q": stacked("position", 1 / DEGREE),
        "qd": stacked("velocity", 1 / DEGREE),
        "tau": stacked("effort", 1e3),
        "Ts": np.array([[2e-3]]),
    }
    log = {name: values.T if across else values for name, values in log.items()}
    if version == "5":
        path = write_mat(tmp_path / "log_3.mat", {"log": log, "note": "by hand"})
    else:
        path = write_mat73(tmp_path / "log_3.mat", {f"log.{name}": values for name, values in log.items()})
    assert set(column_names(path)) == {"log.t", *(f"log.{s}[{k}]" for s in ("q", "qd", "tau") for k in (0, 1))}
    found = read_recording(path, described(tmp_path, ARRAYS))
    assert found.repetition == 3
    assert_same(found, expected(tmp_path))


def element(kind: int, content: bytes) -> bytes:
    """A data element of a MAT file, version 5."""
    return struct.pack("<2I", kind, len(content)) + content.ljust(-(-len(content) // 8) * 8, b"\0")


def test_a_table_in_a_mat_file_is_left_out_and_the_arrays_beside_it_are_read(tmp_path):
    path = write_mat(tmp_path / "a.mat", {"t": MADE["time"]})
    size = element(6, struct.pack("<2I", 6, 0)) + element(5, struct.pack("<2i", 1, 1)) + element(1, b"")
    words = [element(1, word) for word in (b"runs", b"MCOS", b"table")]
    table = element(6, struct.pack("<2I", 17, 0)) + b"".join(words) + element(14, size + element(9, b"\0" * 8))
    path.write_bytes(path.read_bytes() + element(14, table))
    assert column_names(path) == ("t",)
    np.testing.assert_array_equal(read_columns(path, ["t"])["t"], MADE["time"])


def test_a_mat_file_without_arrays_or_whole_is_refused(tmp_path):
    assert "no column of numbers" in refusal(write_mat(tmp_path / "a.mat", {"note": "text"}), load_robot())
    path = write_mat(tmp_path / "b.mat", {"t": MADE["time"]})
    path.write_bytes(path.read_bytes()[:300])
    assert "not a whole mat file" in refusal(path, load_robot())
    path.write_bytes(b"")
    assert "empty" in refusal(path, load_robot())
