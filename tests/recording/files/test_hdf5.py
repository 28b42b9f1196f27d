"""HDF5 files give the recording that the contract's Parquet gives."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files import column_names, read_columns
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot
from tests.recording.files.formats import (
    JOINTS,
    write_hdf5,
)
from tests.recording.files.made import MADE, assert_same, described, expected
from tests.recording.made import refusal


def test_data_sets_of_hdf5_are_determined_by_their_path(tmp_path):
    content = {"arm/t_ns": np.rint(MADE["time"] * 1e9).astype(np.int64)}
    for joint in JOINTS:
        content[f"arm/{joint}/turns"] = MADE[f"{joint}.position"] / (2 * np.pi)
        content[f"arm/{joint}/velocity"] = MADE[f"{joint}.velocity"]
        content[f"arm/{joint}/effort"] = MADE[f"{joint}.effort"]
    path = write_hdf5(tmp_path / "log.h5", content)
    robot = described(
        tmp_path,
        "{time: {column: arm/t_ns, unit: ns}, position: {column: 'arm/{joint}/turns', unit: turn}, "
        "velocity: {column: 'arm/{joint}/velocity'}, effort: {column: 'arm/{joint}/effort'}}",
    )
    assert_same(read_recording(path, robot), expected(tmp_path))


def test_fields_of_a_table_in_hdf5_are_columns(tmp_path):
    import h5py

    table = np.zeros(5, dtype=[("t", "f8"), ("q", "f4", (3,)), ("label", "S4")])
    table["t"], table["q"][:, 1] = np.arange(5), 7.0
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["log"] = table
    assert column_names(tmp_path / "a.hdf5") == ("log.t", "log.q[0]", "log.q[1]", "log.q[2]")
    np.testing.assert_array_equal(read_columns(tmp_path / "a.hdf5", ["log.q[1]"])["log.q[1]"], np.full(5, 7.0))


def test_a_damaged_hdf5_file_is_refused(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes(b"not at all")
    assert "not a whole h5 file" in refusal(path, load_robot())
    whole = write_hdf5(path, {"t": MADE["time"]})
    whole.write_bytes(whole.read_bytes()[:900])
    assert "not a whole h5 file" in refusal(path, load_robot())


def outside(path, file) -> None:
    """Put a data set into a file that is kept by another, in each of three ways."""
    import h5py

    raw = path.with_name("raw.bin")
    np.arange(8.0).tofile(raw)
    with h5py.File(path.with_name("other.h5"), "w") as other:
        other["x"] = np.arange(8.0)
    layout = h5py.VirtualLayout(shape=(8,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(path.with_name("other.h5")), "x", shape=(8,))
    kind = path.stem
    if kind == "raw":
        file.create_dataset("q", shape=(8,), dtype="f8", external=[(str(raw), 0, 64)])
    elif kind == "link":
        file["q"] = h5py.ExternalLink(str(path.with_name("other.h5")), "/x")
    else:
        file.create_virtual_dataset("q", layout)


@pytest.mark.parametrize("kind", ["raw", "link", "virtual"])
def test_numbers_of_another_file_are_refused(tmp_path, kind: str):
    import h5py

    path = tmp_path / f"{kind}.h5"
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(8.0)
        outside(path, file)
    for read in (lambda: column_names(path), lambda: read_columns(path, ["t", "q"])):
        with pytest.raises(RecordingError, match=f"{kind}.h5: 'q' leads to numbers in another file; save a recording"):
            read()


def test_links_within_a_file_are_followed_and_rings_of_groups_end(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = np.arange(8.0)
        file["soft"] = h5py.SoftLink("/t")
        file["nowhere"] = h5py.SoftLink("/etc/hostname")
        group = file.create_group("g")
        group["q"] = np.arange(8.0)
        group["me"] = group
        group["up"] = h5py.SoftLink("/")
    assert column_names(tmp_path / "a.h5") == ("g/q", "soft", "t")


def test_a_name_that_is_no_text_is_refused(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file[b"\xff"] = np.arange(8.0)
    with pytest.raises(RecordingError, match=r"the name b'\\xff' in it is not text in UTF-8; rename it"):
        column_names(tmp_path / "a.h5")
