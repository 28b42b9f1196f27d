"""What a file would unpack to is refused before it is read; nothing is allocated past the limit."""

from __future__ import annotations

import os
import platform
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import MemoryLimit, UsageError
from scara_ident.memory import MIN_SHARE, check_memory, limit, read_text, set_limit, within_limit
from scara_ident.recording.files import column_names, read_columns

GIGA = 1e9


@pytest.fixture(autouse=True)
def _small() -> Iterator[None]:
    set_limit(0.2)
    yield
    set_limit(None)


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def write_zeros_mat(path: Path, count: int) -> None:
    """A MATLAB file of some kilobytes that holds `count` zeros."""
    head = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", count, 1)) + element(1, b"time")
    head += struct.pack("<II", 9, 8 * count)
    packer = zlib.compressobj(9)
    packed = packer.compress(struct.pack("<II", 14, len(head) + 8 * count) + head)
    for _ in range(8 * count // 10**6):
        packed += packer.compress(bytes(10**6))
    packed += packer.flush()
    start = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    path.write_bytes(start + struct.pack("<II", 15, len(packed)) + packed)


def test_results_of_gigabytes_are_refused_unread(tmp_path: Path):
    path = tmp_path / "identification.json"
    path.write_text("{}")
    assert read_text(path) == "{}"
    os.truncate(path, 30_000_000)
    with pytest.raises(MemoryLimit, match="set_limit"):
        read_text(path)


def test_the_limit_is_half_of_the_machine_unless_set():
    assert limit() == 0.2 * GIGA
    set_limit(None)
    assert 0.05 * GIGA < limit() < 1e15
    with pytest.raises(UsageError, match=r"^gigabytes "):
        set_limit(0.5 * MIN_SHARE)
    with pytest.raises(UsageError, match=r"^gigabytes "):
        set_limit(float("nan"))


def test_what_would_take_too_much_is_said_in_one_line():
    check_memory(Path("a.csv"), 0.1 * GIGA)
    with pytest.raises(MemoryLimit, match=r"a.csv: .*0.3 GB.*more than 0.2 GB; cut the file, .*set_limit"):
        check_memory(Path("a.csv"), 0.3 * GIGA)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system does not limit the address space")
def test_an_allocation_past_the_limit_is_an_error_and_the_limit_ends_with_the_block():
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    with pytest.raises(MemoryLimit, match=r"more than 0\.2 GB"), within_limit(Path("a.mat")):
        bytearray(int(1.5 * GIGA))
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mat", "h5", "parquet", "csv"])
def test_a_small_file_that_unpacks_to_gigabytes_is_refused(tmp_path: Path, kind: str):
    path = tmp_path / f"small.{kind}"
    if kind == "mat":
        write_zeros_mat(path, 26_000_000)
    elif kind == "h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            file.create_dataset("time", (10**10,), dtype="f8", chunks=(10**6,))
    elif kind == "parquet":
        import polars as pl

        pl.DataFrame({"time": pl.zeros(10_000_000, dtype=pl.Float64, eager=True)}).write_parquet(path)
    else:
        with path.open("wb") as file:
            file.write(b"time,joint1.position\n")
            file.truncate(100_000_000)
    assert kind == "csv" or path.stat().st_size < 1_000_000
    with pytest.raises(MemoryLimit, match=f"small.{kind}: .*set_limit"):
        column_names(path)
        read_columns(path, ["time"])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system does not limit the address space")
def test_a_forged_length_in_a_bag_is_refused(tmp_path: Path):
    pytest.importorskip("rosbags")
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n\x01" + struct.pack("<Q", 2**33) + bytes(100))
    with pytest.raises(MemoryLimit, match=r"a\.mcap: .*set_limit"):
        column_names(path)


def test_what_fits_is_read(tmp_path: Path):
    path = tmp_path / "a.mat"
    write_zeros_mat(path, 1_000_000)
    assert np.array_equal(read_columns(path, ["time"])["time"], np.zeros(1_000_000))


FAULTS = """
import resource
import sys

import numpy as np

from scara_ident.memory import keep_freed


def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(10):
        _ = [np.ones(2**18) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


if sys.argv[1] == "kept":
    keep_freed()
faults()
print(faults() * resource.getpagesize())
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of glibc")
def test_freed_memory_is_kept_for_the_next_arrays():
    # In processes of their own: what others have left in the heap of this one is given back at times.
    # Nor may they be told what Dask tells its workers, which it leaves in the environment of who began them.
    told = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    cleared, kept = (
        int(subprocess.run([sys.executable, "-c", FAULTS, how], check=True, capture_output=True, env=told).stdout)
        for how in ("given back", "kept")
    )
    whole = 10 * 8 * 8 * 2**18
    assert cleared > 0.5 * whole
    assert kept < 0.05 * whole
