"""Packages made for tests, as pip leaves them: a module, and metadata that name its entry points."""

from __future__ import annotations

from pathlib import Path


def make_installed(place: Path, package: str, group: str, points: dict[str, str], code: str = "") -> None:
    """Make a package of one module in a folder on Python's path."""
    (place / f"{package}.py").write_text(code)
    info = place / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    listed = "\n".join(f"{name} = {value}" for name, value in points.items())
    (info / "entry_points.txt").write_text(f"[{group}]\n{listed}\n")
