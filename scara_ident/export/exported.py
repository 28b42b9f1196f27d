"""An identified model in a format of other programs, with what that costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.export.c_header import c_header, c_name
from scara_ident.export.casadi_module import casadi_module
from scara_ident.export.conventions import convention_lines
from scara_ident.export.forms import FORMS, Said, friction_said, offset_said, possible_standard, said_by, with_code
from scara_ident.export.friction import JointFriction, JointSideFriction, joint_side
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.export.mjcf import mjcf_text
from scara_ident.export.mujoco_module import mujoco_module
from scara_ident.export.pinocchio_module import pinocchio_module
from scara_ident.export.ros2 import ros2_text
from scara_ident.export.traced_model import TracedModel, trace_model
from scara_ident.export.urdf import urdf_text
from scara_ident.files import slug, write_json, write_text, written_together
from scara_ident.manners import listed
from scara_ident.model.terms import Friction, Offset, RigidBody


@dataclass(frozen=True, eq=False)
class Exported:
    """What is to be written.

    Attributes
    ----------
    to : str
        A name of `FORMS`.
    files : mapping of str to str
        Text by name.
    alone : Said
        What the format itself says.
    beside : Said or None
        What it says together with the code beside it; None where there is none.
    notes : tuple of str
    """

    to: str
    files: dict[str, str]
    alone: Said
    beside: Said | None
    notes: tuple[str, ...]


def export_model(found: IdentifiedModel, to: str) -> Exported:
    """Say an identified model in a format.

    Parameters
    ----------
    found : IdentifiedModel
    to : str
        A name of `FORMS`.

    Raises
    ------
    EstimationError
        If the format has bodies and no arm can have the identified parameters, or nearly.
    ScaraIdentError
        If a link cannot exist or has no mass, see `urdf_text` and `mjcf_text`.
    """
    form = FORMS[to]
    standard, notes = possible_standard(found) if form.bodies else (None, ())
    notes = (*_open(found), *notes)
    alone = said_by(form, found, standard)
    if standard is None:
        model = trace_model(found.model, alone.value)
        about = about_lines(found, alone)
        name = c_name(found.robot.name)
        if to == "c":
            return Exported(to, {f"{name}.h": c_header(model, about)}, alone, None, notes)
        return Exported(to, {f"{name}_casadi.py": casadi_module(model, about)}, alone, None, notes)
    files, beside, more = _WITH_BODIES[to](found, standard, alone)
    return Exported(to, files, alone, beside, (*notes, *more))


def write_exported(found: IdentifiedModel, exported: Exported, folder: Path, source: str) -> dict[str, Any]:
    """Write the files with ``export.json``, whole or not at all; return the latter's content."""
    content = exported_dict(found, exported, source)
    with written_together(folder) as place:
        for name, text in exported.files.items():
            write_text(place / name, text)
        write_json(place / "export.json", content)
    return content


def exported_dict(found: IdentifiedModel, exported: Exported, source: str) -> dict[str, Any]:
    """Return the content of ``export.json``; ``source`` is the result that it was made of."""
    both = {"exported": exported.alone} | ({} if exported.beside is None else {"with_code": exported.beside})
    return {
        "result": source,
        "robot": found.robot.name,
        "to": exported.to,
        "files": list(exported.files),
        "errors_of": found.held_out[0],
        "errors": {"model": found.errors(found.value)} | {key: found.errors(said.value) for key, said in both.items()},
        "missing": {
            key: [{"what": what, "why": why} for what, why in said.missing] for key, said in both.items()
        },
        "refitted": {key: list(said.refitted) for key, said in both.items()},
        "notes": list(exported.notes),
    }  # fmt: skip


def said_lines(word: str, said: Said) -> list[str]:
    """Say what a form cannot say and what was fitted again for that; ``word`` is the form."""
    lines = [f"{word}: without {what}: {why}" for what, why in said.missing]
    again = f"{word}: fitted again to the same recordings: {', '.join(said.refitted)}"
    return [*lines, again] if said.refitted else lines


def about_lines(found: IdentifiedModel, said: Said) -> tuple[str, ...]:
    """Say what a file's reader should know: errors, what is missing, directions and sides."""
    kind = "held out" if found.held_out[0] == "validation" else "on the fitted recordings"
    model, own = found.errors(found.value), found.errors(said.value)
    lines = [
        f"{name}: rms error {kind} {_number(own[name])} {found.robot.torque_unit(j)}, of the model {_number(model[name])}."
        for j, name in enumerate(found.robot.joints)
    ]
    lines += [*_speeds(found), *(f"{note[0].upper()}{note[1:]}." for note in _open(found))]
    missing = (f"Not exported: {what}: {why}." for what, why in said.missing)
    return (*lines, *missing, *convention_lines(found.robot))


def _speeds(found: IdentifiedModel) -> Iterator[str]:
    """Say up to which speeds the model was fitted."""
    if found.reached is not None:
        robot = found.robot
        each = (
            f"{joint} {v:.3g} {robot.position_unit(j)}/s"
            for j, (joint, v) in enumerate(zip(robot.joints, found.reached.speed, strict=True))
        )
        yield f"Fitted up to these speeds, beyond which friction is extrapolated: {', '.join(each)}."


def _open(found: IdentifiedModel) -> tuple[str, ...]:
    """Say which parameters the recordings do not tell, and which effects those held out speak against."""
    return (*_undetermined(found), *found.doubts)


def _undetermined(found: IdentifiedModel) -> tuple[str, ...]:
    names = [name for name, missing in zip(found.model.names, found.undetermined, strict=True) if missing]
    if not names:
        return ()
    return (f"the recordings do not determine {listed(names, 12)}: torques that depend on them are not known",)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


Parts = tuple[dict[str, str], Said | None, tuple[str, ...]]


def _urdf(found: IdentifiedModel, standard: Array, alone: Said, *, rotors_reported: bool = False) -> Parts:
    text, notes = urdf_text(found.robot, standard, friction_said(found, alone.value), rotors_reported=rotors_reported)
    return {f"{_stem(found)}.urdf": text}, None, notes


def _ros2(found: IdentifiedModel, standard: Array, alone: Said) -> Parts:
    text, notes = urdf_text(found.robot, standard, rotors_reported=True)
    urdf = f"{_stem(found)}.urdf"
    armature = standard[10 * found.robot.n :]
    name = f"{c_name(found.robot.name)}_ros2.yaml"
    about = about_lines(found, alone)
    return {urdf: text, name: ros2_text(found, alone.value, armature, urdf, about)}, None, notes


def _pinocchio(found: IdentifiedModel, standard: Array, alone: Said) -> Parts:
    files, _, notes = _urdf(found, standard, alone, rotors_reported=True)
    beside = said_by(with_code(FORMS["pinocchio"]), found, standard)
    friction, further = _divided(found, beside.value, offset=True)
    module = pinocchio_module(
        next(iter(files)),
        standard[10 * found.robot.n :],
        _known(joint_side(found.robot, friction_said(found, alone.value))),
        friction,
        further,
        about_lines(found, beside),
    )
    return {**files, f"{c_name(found.robot.name)}_pinocchio.py": module}, beside, notes


def _mjcf(found: IdentifiedModel, standard: Array, alone: Said) -> Parts:
    offset = offset_said(found, alone.value)
    text, notes = mjcf_text(found.robot, standard, friction_said(found, alone.value), offset)
    beside = said_by(with_code(FORMS["mjcf"]), found, standard)
    friction, further = _divided(found, beside.value, offset=False)
    module = mujoco_module(further, friction, offset_said(found, beside.value), about_lines(found, beside))
    return {f"{_stem(found)}.xml": text, f"{c_name(found.robot.name)}_mujoco.py": module}, beside, notes


def _stem(found: IdentifiedModel) -> str:
    return f"{slug(found.robot.name, 'robot')}_identified"


_WITH_BODIES: dict[str, Callable[[IdentifiedModel, Array, Said], Parts]] = {
    "urdf": _urdf,
    "mjcf": _mjcf,
    "pinocchio": _pinocchio,
    "ros2": _ros2,
}


def _divided(found: IdentifiedModel, value: Array, *, offset: bool) -> tuple[JointSideFriction, TracedModel]:
    """Part what is lost into friction that brakes, dry and viscous, and code for the rest.

    ``offset`` says whether the constant torque is in the code.
    """
    said = friction_said(found, value)
    coulomb, viscous = (np.maximum(np.nan_to_num(part), 0.0) for part in (said.coulomb, said.viscous))
    friction = JointFriction(coulomb, viscous)
    rest = value.copy()
    for term in found.model.terms:
        place = found.model.place(term)
        if isinstance(term, RigidBody) or (isinstance(term, Offset) and not offset):
            rest[place] = 0.0
        elif isinstance(term, Friction):
            table = rest[place].reshape(found.robot.n, -1)
            for k, power in enumerate(term.powers):
                if power < 2:
                    table[:, k] -= (friction.coulomb, friction.viscous)[power]
    return joint_side(found.robot, friction), trace_model(found.model, rest)


def _known(friction: JointSideFriction) -> JointSideFriction:
    """Return friction with none where it is not known."""
    return JointSideFriction(np.nan_to_num(friction.coulomb), np.nan_to_num(friction.viscous), friction.notes)
