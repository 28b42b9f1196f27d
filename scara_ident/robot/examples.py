"""Robots of the package example-robot-data, by their names."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from scara_ident.errors import NoRobotError, RobotError

PACKAGE = "example-robot-data"


def is_name(source: Path, folder: Path = Path()) -> bool:
    """Tell whether a word is a robot's name: one word without a suffix, or that of a robot, and no file in the folder it is read from.

    A folder of that name, as results are kept in, hides no robot that there is.
    """
    here = folder / source
    if len(source.parts) != 1 or here.is_file():
        return False
    return (not here.exists() and not source.suffix) or _plain(source.name) in _robots()


def urdf_of(source: Path) -> Path:
    """Return a file as it is, and the URDF of a robot of example-robot-data for its name.

    Raises
    ------
    RobotError
        As `example_urdf`.
    """
    return example_urdf(source.name) if is_name(source) else source


def example_urdf(name: str) -> Path:
    """Return the URDF of a robot of example-robot-data.

    Parameters
    ----------
    name : str
        One of `example_robots`; capitals and small letters are the same, and so are ``-`` and ``_``.

    Raises
    ------
    NoRobotError
        In one line that names the robots of similar names.
    """
    robots = _robots()
    word = _plain(name)
    if word in robots:
        return robots[word]
    near = get_close_matches(word, robots, n=4)
    hint = f"did you mean {' or '.join(near)}?" if near else f"it has {', '.join(robots)}"
    raise NoRobotError(f"{name}: no such file, nor a robot of {PACKAGE}; {hint}")


def example_robots() -> dict[str, Path]:
    """Return the URDFs of example-robot-data by their names: ``ur5``, ``panda``, ``kinova``, ....

    A name is that of the file without ``_robot``, as in ``ur5_robot.urdf``, or that of the robot's folder where it
    holds one URDF only; in small letters, with ``_`` for ``-``.

    Raises
    ------
    RobotError
        If the package is not installed.
    """
    return dict(_robots())


# The package's thousand files are looked up one by one, which took three quarters of the time of loading a robot.
@cache
def _robots() -> dict[str, Path]:
    try:
        files = distribution(PACKAGE).files or []
    except PackageNotFoundError:
        raise RobotError(f"robots by name need the package {PACKAGE}: pip install {PACKAGE}") from None
    folders: dict[str, list[Path]] = {}
    for file in files:
        if file.suffix == ".urdf" and "robots" in file.parts:
            folder = file.parts[file.parts.index("robots") + 1]
            folders.setdefault(folder, []).append(Path(str(file.locate())))
    named: dict[str, Path] = {}
    for folder, urdfs in folders.items():
        if len(urdfs) == 1:
            named[_plain(folder).removesuffix("_description")] = urdfs[0]
    # Where there are both, ur3_robot.urdf is the package's ur3, not ur3.urdf.
    for urdf in sorted((urdf for urdfs in folders.values() for urdf in urdfs), key=lambda urdf: "_robot" in urdf.stem):
        named[_plain(urdf.stem).removesuffix("_robot")] = urdf
    return dict(sorted(named.items()))


def _plain(name: str) -> str:
    return name.lower().replace("-", "_")
