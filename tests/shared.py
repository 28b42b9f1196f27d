"""Where measured data may be found; tests that need it skip with a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
# Seconds after which another program hangs; no measure of speed, which is that of the machine.
PATIENCE = 1800


def shared_path(*parts: str) -> Path:
    """Return a path below ``../shared`` or skip the running test."""
    path = SHARED.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"needs {path.relative_to(ROOT.parent)} beside the project, which is not here")
    return path
