"""Arguments that the functions which learn from recordings share."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from scara_ident.errors import ArgumentError, RecordingError
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.recording.recording import Recording, distinctly_named, read_recordings
from scara_ident.recording.tables import check_robot
from scara_ident.robot.robot import Robot

Recordings: TypeAlias = Recording | str | Path | Iterable[Recording | str | Path]
"""A recording, a file, a folder or glob of files, or several of these."""


def recordings_of(recordings: Recordings, robot: Robot, what: str = "recordings") -> tuple[Recording, ...]:
    """Return recordings, read where they are given as files.

    Parameters
    ----------
    recordings : Recording, path, or several of these
        Paths are those of `read_recordings`; what is of one name is named as there.
    what : str, optional
        Names the argument in errors.

    Raises
    ------
    ArgumentError
        Something else was given.
    RecordingError
        A file cannot be used, or a recording is of other joints.
    """
    check_robot(robot)
    given = (recordings,) if isinstance(recordings, (Recording, str, Path)) else recordings
    if not isinstance(given, Iterable) or hasattr(given, "columns"):
        raise _unknown(what, recordings)
    found: list[Recording] = []
    for item in given:
        if isinstance(item, (str, Path)):
            found += read_recordings([item], robot)
        elif isinstance(item, Recording):
            found.append(item)
        else:
            raise _unknown(what, item)
    for recording in found:
        if recording.joints != robot.joints:
            raise RecordingError(
                f"{recording.path or recording.name}: a recording of {', '.join(recording.joints)}; the robot's joints are "
                f"{', '.join(robot.joints)}: read it with this robot"
            )
    return distinctly_named(found)


def model_of(model: str | TorqueModel, robot: Robot) -> TorqueModel:
    """Return a model, built where it is given by name.

    Raises
    ------
    UsageError
        There is no model of this name.
    ArgumentError
        Something else was given, or a model of another robot.
    """
    if isinstance(model, str):
        return build_model(robot, model)
    if not isinstance(model, TorqueModel):
        raise ArgumentError(
            f"model: expected a name or a TorqueModel, as build_model gives; found {type(model).__name__}"
        )
    return model


def _unknown(what: str, item: object) -> ArgumentError:
    hint = (
        "read_frame makes a recording of it" if hasattr(item, "columns") else "read_arrays makes a recording of arrays"
    )
    return ArgumentError(
        f"{what}: expected recordings, or files or folders of them; found {type(item).__name__}"
        + (f"; {hint}" if hasattr(item, "columns") or hasattr(item, "shape") else "")
    )
