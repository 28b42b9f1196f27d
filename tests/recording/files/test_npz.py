"""NumPy's archives give the recording that the contract's Parquet gives."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files import column_names, read_columns
from scara_ident.recording.recording import read_recording
from tests.recording.files.formats import DEGREE
from tests.recording.files.made import MADE, assert_same, described, expected, stacked

ARRAYS = "{time: {column: t}, position: {column: 'q[{index}]', unit: deg}, \
effort: {column: 'tau[{index}]', unit: mN m}, velocity: {column: 'qd[{index}]', unit: deg/s}}"


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("across", [False, True])
def test_matrices_of_an_archive_are_channels_whichever_axis_is_time(tmp_path, save, across):
    log = {
        "q": stacked("position", 1 / DEGREE),
        "qd": stacked("velocity", 1 / DEGREE),
        "tau": stacked("effort", 1e3),
    }
    log = {name: values.T if across else values for name, values in log.items()}
    path = tmp_path / "log_3.npz"
    objects = np.array([{"by": "hand"}], dtype=object)
    save(path, t=MADE["time"], robot=np.array("arm"), rate=500.0, notes=objects, **log)
    assert set(column_names(path)) == {"t", *(f"{s}[{k}]" for s in ("q", "qd", "tau") for k in (0, 1))}
    found = read_recording(path, described(tmp_path, ARRAYS))
    assert found.repetition == 3
    assert_same(found, expected(tmp_path))
    with pytest.raises(RecordingError, match="no column 'x'"):
        read_columns(path, ["x"])


def test_what_is_no_archive_of_numbers_is_said(tmp_path):
    path = tmp_path / "a.npz"
    path.write_bytes(b"no")
    with pytest.raises(RecordingError, match="not a whole npz file"):
        column_names(path)
    np.savez(path, robot=np.array("arm"))
    with pytest.raises(RecordingError, match="no column of numbers"):
        column_names(path)
    np.savez(path, q=np.zeros((600, 2)))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RecordingError, match="not a whole npz file"):
        column_names(path)
