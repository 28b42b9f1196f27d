"""Write the identified arm to files for other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.errors import EstimationError, ScaraIdentError
from scara_ident.export.exported import export_model, said_lines
from scara_ident.export.forms import possible_standard
from scara_ident.export.identified_model import IdentifiedModel, identified_model
from scara_ident.files import write_text
from scara_ident.identification.identify import Identification


def export_urdf(found: Identification | Diagnosis, path: Path | str) -> tuple[str, ...]:
    """Write the identified arm as a URDF: the robot's own file with identified inertials and joint dynamics.

    Friction is fitted again with the terms that the format has, see `scara_ident.export.forms`.

    Parameters
    ----------
    found : Identification or Diagnosis
        What `identify` or `diagnose` returned.
    path : path
        File to write, completely or not at all.

    Returns
    -------
    tuple of str
        Remarks for the user, and what the format cannot hold.

    Raises
    ------
    EstimationError
        If no arm can have the identified parameters, even approximately.
    ScaraIdentError
        If a link is physically impossible, or a file cannot be read or written.

    Examples
    --------
    >>> from scara_ident import export_mjcf, export_urdf, identify, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> result = identify(robot, [run.recording], method="consistent")
    >>> notes = export_urdf(result, "identified.urdf"), export_mjcf(result, "identified.xml")
    """
    return _export(found, "urdf", Path(path))


def export_mjcf(found: Identification | Diagnosis, path: Path | str) -> tuple[str, ...]:
    """Write the identified arm as a model of MuJoCo.

    Parameters, results and errors are those of `export_urdf`; in addition MuJoCo refuses a moving link without mass.
    """
    return _export(found, "mjcf", Path(path))


def robot_files(found: IdentifiedModel) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the arm's URDF and MJCF by file name, those that can be written, and what a person should know of them."""
    try:
        standard, notes = possible_standard(found)
    except EstimationError as error:
        return {}, (f"no URDF and no MJCF is written: {error}",)
    files: dict[str, str] = {}
    all_notes = [*notes]
    for to in ("urdf", "mjcf"):
        try:
            name, text, more = _model_file(replace(found, standard=standard), to)
        except ScaraIdentError as error:
            all_notes.append(f"no {to.upper()} is written: {error}")
        else:
            files[name] = text
            all_notes += more
    return files, tuple(dict.fromkeys(all_notes))


def _export(found: Identification | Diagnosis, to: str, path: Path) -> tuple[str, ...]:
    _, text, notes = _model_file(identified_model(found), to)
    write_text(path, text)
    return notes


def _model_file(found: IdentifiedModel, to: str) -> tuple[str, str, tuple[str, ...]]:
    """Return name and text of a form's model file, without the code beside it, and what to know of it."""
    exported = export_model(found, to)
    name, text = next(iter(exported.files.items()))
    return name, text, (*exported.notes, *said_lines(to.upper(), exported.alone))
