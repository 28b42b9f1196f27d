"""The same recordings give the same bytes, wherever the program runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PLACES = (
    {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "LC_ALL": "C", "TZ": "UTC", "PYTHONHASHSEED": "0"},
    {"OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4", "LC_ALL": "C.UTF-8", "TZ": "Asia/Kathmandu", "PYTHONHASHSEED": "4242"},
)  # fmt: skip


def all_cores() -> None:
    """Let a process use all cores that the machine gives, whatever those of this one."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))


def one_core() -> None:
    """Let a process use one of the cores that this one may."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


@pytest.mark.slow
def test_cores_threads_locale_time_zone_and_hash_seed_change_no_byte(folder: Path, tmp_path: Path):
    written = []
    for k, (place, cores) in enumerate(zip(PLACES, (one_core, all_cores), strict=True)):
        output = tmp_path / str(k)
        subprocess.run(
            [sys.executable, "-m", "scara_ident", "diagnose", *sorted(folder.glob("OJD*")), "--validate", *folder.glob("CI*"),
             "--output", output],
            env={**os.environ, **place}, check=True, capture_output=True, preexec_fn=cores,
        )  # fmt: skip
        written.append({path.name: path.read_bytes() for path in output.iterdir()})
    assert len(written[0]) > 0
    assert written[0] == written[1]
