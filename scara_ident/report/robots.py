"""The identified arm as files for other programs."""

from __future__ import annotations

from pathlib import Path

from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.export.friction import friction_of
from scara_ident.export.mjcf import mjcf_text
from scara_ident.export.urdf import urdf_text
from scara_ident.report.files import write_text


def write_robots(folder: Path, estimate: ConsistentEstimate) -> tuple[str, ...]:
    """Write the identified arm as URDF and MJCF.

    Parameters
    ----------
    folder : Path
    estimate : ConsistentEstimate

    Returns
    -------
    tuple of str
        What a person should know of what the formats cannot hold.
    """
    robot = estimate.model.robot
    friction = friction_of(estimate)
    urdf, urdf_notes = urdf_text(robot, estimate.standard, friction)
    mjcf, mjcf_notes = mjcf_text(robot, estimate.standard, friction)
    write_text(folder / f"{robot.name}_identified.urdf", urdf)
    write_text(folder / f"{robot.name}_identified.xml", mjcf)
    return tuple(dict.fromkeys((*urdf_notes, *mjcf_notes)))
