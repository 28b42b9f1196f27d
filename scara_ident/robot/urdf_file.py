"""A URDF from its file: as XML, checked, and as Pinocchio's model."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pinocchio as pin

from scara_ident.errors import NoRobotError, RobotError
from scara_ident.files import foreign_letter, path_fault, real_path
from scara_ident.quiet import quiet_stderr
from scara_ident.robot.urdf_validation import XACRO, urdf_fault

# Bytes: those of a humanoid are a few hundred thousand.
LARGEST_URDF = 30e6


def read_urdf(urdf: Path, source: Path) -> ElementTree.Element:
    """Read a URDF and check it: what the rest of the program takes from it has been seen to be there and usable.

    Parameters
    ----------
    source : Path
        What named it, for messages.

    Raises
    ------
    RobotError
        In one line, if it cannot be read or used.
    """
    if (fault := path_fault(urdf)) is not None:
        raise RobotError(f"{source}: urdf: {fault}")
    try:
        if urdf.stat().st_size > LARGEST_URDF:
            raise RobotError(f"{urdf}: {urdf.stat().st_size:.2g} bytes, more than any URDF; give the robot's URDF")
        root = ElementTree.parse(urdf).getroot()
    except FileNotFoundError:
        if real_path(source) == real_path(urdf):
            raise NoRobotError(f"{source}: no such file; give a robot.yaml or a URDF") from None
        raise RobotError(f"{source}: urdf: no such file: {urdf}") from None
    except OSError as error:
        raise RobotError(f"{source}: urdf: cannot read {urdf}: {error.strerror}") from None
    except ElementTree.ParseError as error:
        if (letter := foreign_letter(urdf.read_bytes())) is not None:
            raise RobotError(f"{urdf}, {letter}") from None
        hint = f"; if it is xacro's, {XACRO}" if "unbound prefix" in str(error) else ""
        raise RobotError(f"{urdf}: not well-formed XML: {error}{hint}") from None
    except (LookupError, ValueError) as error:
        raise RobotError(
            f"{urdf}: the encoding that its first line names cannot be read ({error}); save it in UTF-8"
        ) from None
    _leave_namespace(root)
    if root.tag != "robot":
        raise RobotError(f"{urdf}: the root element is <{root.tag}>, a URDF has <robot>")
    if (fault := urdf_fault(root)) is not None:
        raise RobotError(f"{urdf}: not a usable URDF: {fault}")
    return root


def _leave_namespace(root: ElementTree.Element) -> None:
    """Take the default namespace off the elements that are in it: some URDFs name a schema, and other readers pass over it."""
    space, end, _ = root.tag.partition("}")
    if end:
        for element in root.iter():
            # A comment has a function for a tag.
            if isinstance(element.tag, str):
                element.tag = element.tag.removeprefix(space + end)


def pinocchio_model(urdf: Path, tree: ElementTree.Element) -> pin.Model:
    """Return Pinocchio's model of a URDF that was read.

    Raises
    ------
    RobotError
        In one line, if Pinocchio refuses it.
    """
    try:
        # As text: Pinocchio takes the bytes of a file for UTF-8, whatever its first line says.
        text = ElementTree.tostring(tree, encoding="unicode")
        with quiet_stderr():
            return pin.buildModelFromXML(text)
    except RecursionError:
        raise RobotError(
            f"{urdf}: not a usable URDF: its elements are nested too deeply; remove what is no URDF"
        ) from None
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split()) or "Pinocchio refuses it"
        raise RobotError(f"{urdf}: not a usable URDF: {reason}") from None
