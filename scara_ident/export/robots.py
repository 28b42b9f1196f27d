"""Write the identified arm to files for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.export.friction import friction_of
from scara_ident.export.mjcf import mjcf_text
from scara_ident.export.urdf import urdf_text
from scara_ident.files import write_text
from scara_ident.identification.identify import Identification, identified_arm


def export_urdf(found: Identification | ConsistentEstimate, path: Path | str) -> tuple[str, ...]:
    """Write the identified arm as a URDF: the robot's own file with other inertials and joint dynamics.

    Parameters
    ----------
    found : Identification or ConsistentEstimate
        What `identify` or `consistent` returned.
    path : path
        File to write, whole or not at all.

    Returns
    -------
    tuple of str
        What a person should know of what the format cannot hold.

    Raises
    ------
    EstimationError
        If no arm can have the identified parameters.
    ScaraIdentError
        If a link cannot exist, or a file cannot be read or written.

    Examples
    --------
    >>> from scara_ident import export_mjcf, export_urdf, identify, load_robot, named_motion, simulate, virtual_arm
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> result = identify(robot, [run.recording], method="consistent")
    >>> notes = export_urdf(result, "identified.urdf"), export_mjcf(result, "identified.xml")
    """
    return _export(urdf_text, found, path)


def export_mjcf(found: Identification | ConsistentEstimate, path: Path | str) -> tuple[str, ...]:
    """Write the identified arm as a model of MuJoCo.

    Parameters, results and errors are those of `export_urdf`; MuJoCo takes no moving link without mass.
    """
    return _export(mjcf_text, found, path)


def _export(
    text_of: Callable[..., tuple[str, tuple[str, ...]]], found: Identification | ConsistentEstimate, path: Path | str
) -> tuple[str, ...]:
    arm = identified_arm(found) if isinstance(found, Identification) else found
    if arm is None:
        raise EstimationError("no arm can have the identified parameters; identify with the method consistent")
    text, notes = text_of(arm.model.robot, arm.standard, friction_of(arm))
    write_text(Path(path), text)
    return notes
