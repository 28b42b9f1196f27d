"""A command begins and ends sooner, and does the same."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.shared import ROOT


def printed(program: str) -> list[str]:
    """Run lines of Python in a process of their own and return what they print."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "3"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_scipy_is_loaded_when_it_is_used_and_its_blas_has_one_thread_then() -> None:
    program = """
import sys
from scara_ident.cli.startup import begin_soon
from scara_ident.threads import one_blas_thread
begin_soon()
with one_blas_thread():
    print("scipy.linalg" in sys.modules)
    import scipy.linalg
    from threadpoolctl import threadpool_info
    print({item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"})
"""
    assert printed(program) == ["False", "{1}"]


def test_what_goes_with_the_process_is_not_looked_through_for_garbage() -> None:
    program = """
import atexit, gc
from scara_ident.cli.startup import begin_soon
atexit.register(lambda: print(gc.get_freeze_count() > 0))
begin_soon()
print(gc.get_freeze_count())
"""
    assert printed(program) == ["0", "True"]
