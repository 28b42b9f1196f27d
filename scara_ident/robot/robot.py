"""The robot: a URDF with what a URDF cannot say."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import ArgumentError, RobotError, UsageError
from scara_ident.files import path_fault, real_path
from scara_ident.manners import Frozen, several
from scara_ident.robot.description import JointDescription, RobotDescription, read_description
from scara_ident.robot.examples import urdf_of
from scara_ident.robot.joint_limits import position_limits, speed_and_effort_limits
from scara_ident.robot.mimic import Follower, coupled_ends, followers, lock_followers, refuse_coupled
from scara_ident.robot.rotors import RotorGuess, guess_rotors
from scara_ident.robot.signal_map import Channels, build_channels, check_rated_torque
from scara_ident.robot.transmissions import reductions, rotor_inertias
from scara_ident.robot.urdf_file import pinocchio_model, read_urdf
from scara_ident.robot.urdf_validation import MOVABLE, XACRO

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False, repr=False)
class Robot(Frozen):
    """An arm whose joints are to be identified.

    Attributes
    ----------
    name : str
        Name of the robot in its URDF.
    urdf : Path
        File the model came from.
    model : pinocchio.Model
        Model of the identified joints only; every other movable joint is locked. Every joint has one degree of freedom,
        so ``model.nv == n``.
    joints : tuple of str
        The n joints in the order of the robot description.
    links : tuple of str
        For every joint the link that it moves, in the same order.
    order : ndarray of int, shape (n,)
        Velocity index in ``model`` of each joint.
    prismatic : ndarray of bool, shape (n,)
        Which joints translate.
    reduction : ndarray, shape (n,)
        Motor turns per joint turn; negative if the gear reverses, never 0.
    rotor_inertia : ndarray, shape (n,)
        Nominal inertia of the rotor on the motor side, kg m^2; 0 if not stated, see `rotor_stated`.
    rotor_stated : ndarray of bool, shape (n,)
        Whether the description or the URDF states it.
    effort_side : {"motor", "joint"}
        Side of the gear on which effort is measured and the equations are written.
    effort_gain : ndarray, shape (n,)
        Torque in N m (N) per unit of the recorded effort.
    lower, upper : ndarray, shape (n,)
        Range of each joint, rad or m; infinite where the URDF gives none, or one that no joint has.
    velocity_limit, effort_limit : ndarray, shape (n,)
        Limits on the joint side, rad/s or m/s and N m or N; infinite where the URDF gives none.
    acceleration_limit, jerk_limit : ndarray, shape (n,)
        rad/s^2 and rad/s^3, or m/s^2 and m/s^3; infinite where the description gives none.
    locked : tuple of (str, float)
        Locked joints and their positions.
    channels : Channels or None
        Columns and units of the recordings; None for the default ones.
    notes : tuple of str
        Decisions about joints that the description does not name.
    """

    name: str
    urdf: Path
    model: pin.Model
    joints: tuple[str, ...]
    links: tuple[str, ...]
    order: NDArray[np.intp]
    prismatic: NDArray[np.bool_]
    reduction: Array
    rotor_inertia: Array
    rotor_stated: NDArray[np.bool_]
    effort_side: Literal["motor", "joint"]
    effort_gain: Array
    lower: Array
    upper: Array
    velocity_limit: Array
    effort_limit: Array
    acceleration_limit: Array
    jerk_limit: Array
    locked: tuple[tuple[str, float], ...]
    channels: Channels | None = None
    notes: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of identified joints."""
        return len(self.joints)

    def _in_short(self) -> str:
        return f"{self.name}: {several(self.n, 'joint')}, effort at the {self.effort_side}"

    @cached_property
    def rotor_guess(self) -> RotorGuess:
        """Armatures that the size of the motors suggests, stated or not."""
        return guess_rotors(self.model, self.order, self.reduction, self.effort_limit, self.prismatic)

    @cached_property
    def row_scale(self) -> Array:
        """Recorded torque per joint torque, shape (n,): 1/N on the motor side, else 1."""
        scale = 1.0 / self.reduction if self.effort_side == "motor" else np.ones(self.n)
        scale.flags.writeable = False
        return scale

    @property
    def drive_sign(self) -> Array:
        """Direction of the recorded torque relative to the joint's, shape (n,)."""
        return np.sign(self.row_scale)

    @property
    def torque_limit(self) -> Array:
        """Effort limit on the side where effort is recorded, shape (n,)."""
        return self.effort_limit * np.abs(self.row_scale)

    def joint_index(self, name: str) -> int:
        """Return the index of a joint in `joints`.

        Raises
        ------
        UsageError
            If there is no such joint; the message lists the joints.
        """
        if name not in self.joints:
            raise UsageError(f"{self.name} has no joint {name!r}; its joints are {', '.join(self.joints)}")
        return self.joints.index(name)

    def by_joint(self, values: Iterable[Value]) -> dict[str, Value]:
        """Return one value for each joint by its name."""
        return dict(zip(self.joints, values, strict=True))

    def torque_unit(self, joint: int) -> str:
        """Return the unit of the recorded torque of a joint after ``effort_gain``."""
        return "N" if self.prismatic[joint] and self.effort_side == "joint" else "N m"

    @property
    def torque_units(self) -> dict[str, str]:
        """The unit of the recorded torque after ``effort_gain``, by joint."""
        return self.by_joint([self.torque_unit(joint) for joint in range(self.n)])

    def position_unit(self, joint: int) -> str:
        """Return the unit of a joint's position."""
        return "m" if self.prismatic[joint] else "rad"

    def armature_unit(self, joint: int) -> str:
        """Return the unit of a rotor's inertia at the joint."""
        return "kg" if self.prismatic[joint] else "kg m^2"

    def standard_parameters(self) -> Array:
        """Return the nominal standard parameters of the URDF, shape (11 n,).

        Ten per body in the order of ``joints``, each in Pinocchio's order (m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz,
        the inertia about the joint's frame), then n armatures N^2 Jm.
        """
        bodies = [self.model.inertias[int(k) + 1].toDynamicParameters() for k in self.order]
        return np.concatenate([*bodies, self.reduction**2 * self.rotor_inertia])


def load_robot(path: Path | str | None = None) -> Robot:
    """Load a robot from its description.

    Parameters
    ----------
    path : path, optional
        A ``robot.yaml``; or a URDF, of which all movable joints are identified, with effort at the joints; or the name
        of such a robot of example-robot-data, such as ``"ur5"``. Default: the embedded SCARA03.

    Returns
    -------
    Robot

    Raises
    ------
    RobotError
        If the description cannot be used; one line names the file, the key and what was expected.

    Examples
    --------
    >>> from scara_ident import load_robot
    >>> load_robot()
    Robot(scara03: 2 joints, effort at the motor)
    >>> load_robot("ur5").joints[0]
    'shoulder_pan_joint'
    """
    if path is None:
        return build_robot(RobotDescription(urdf=embedded_urdf(), effort_side="motor"), embedded_urdf())
    if not isinstance(path, (str, Path)):
        raise ArgumentError(
            f"path: expected that of a robot.yaml or a URDF, or a robot's name; found {type(path).__name__}"
        )
    source = Path(path)
    if (fault := path_fault(source)) is not None:
        raise RobotError(fault)
    source = urdf_of(source)
    if source.suffix.lower() == ".xacro":
        raise RobotError(f"{source}: is xacro's; {XACRO}")
    if source.suffix.lower() in (".urdf", ".xml"):
        return build_robot(RobotDescription(urdf=real_path(source), effort_side="joint"), source)
    return build_robot(read_description(source), source)


def embedded_urdf() -> Path:
    """Return the URDF of the SCARA03: in the installed package, or at the top of a checkout."""
    here = Path(__file__).resolve().parent
    packed = here.parent / "urdf" / "scara03.urdf"
    return packed if packed.exists() else here.parent.parent / "urdf" / "scara03.urdf"


def build_robot(description: RobotDescription, source: Path) -> Robot:
    """Build a robot from a checked description; ``source`` is named in errors."""
    urdf = description.urdf
    tree = read_urdf(urdf, source)
    full = pinocchio_model(urdf, tree)
    coupled = followers(tree)
    names, notes = _identified_joints(description, coupled, tree, source)
    described = description.joints or {}
    joints = [described.get(name) or JointDescription() for name in names]
    description = description.model_copy(update={"locked": lock_followers(description.locked, coupled)})
    model, locked = _lock(full, names, description, source)
    if description.gravity is not None:
        model.gravity.linear = np.asarray(description.gravity, dtype=float)

    ids = [model.getJointId(name) for name in names]
    order = np.array([model.joints[i].idx_v for i in ids], dtype=np.intp)
    position = np.array([model.joints[i].idx_q for i in ids], dtype=np.intp)
    unbounded = np.array([model.joints[i].nq != 1 for i in ids])
    reduction = reductions(names, joints, urdf, tree)
    rotors = rotor_inertias(names, joints, urdf, tree)
    prismatic = ["P" in model.joints[i].shortname().removeprefix("JointModel") for i in ids]
    side = description.effort_side
    if side is None:
        if np.any(reduction != 1.0):
            raise RobotError(
                f"{source}: effort_side: missing; the joints have reductions, so say whether effort is "
                "measured at the motor or at the joint ('motor' or 'joint')"
            )
        side = "joint"
    gain = np.array([joint.effort_gain for joint in joints])
    velocity_limit, effort_limit = speed_and_effort_limits(model, order)
    lower, upper = position_limits(model, position, unbounded, np.array(prismatic))
    at_drive = effort_limit / np.abs(reduction) if side == "motor" else effort_limit
    recorded = None if description.recording is None else description.recording.effort
    check_rated_torque(recorded, names, gain, at_drive, source)
    return Robot(
        name=full.name,
        urdf=urdf,
        model=model,
        joints=tuple(names),
        links=tuple(_moved_link(model, i) for i in ids),
        order=order,
        prismatic=np.array(prismatic),
        reduction=reduction,
        rotor_inertia=np.where(np.isnan(rotors), 0.0, rotors),
        rotor_stated=~np.isnan(rotors),
        effort_side=side,
        effort_gain=gain,
        lower=lower,
        upper=upper,
        velocity_limit=velocity_limit,
        effort_limit=effort_limit,
        acceleration_limit=np.array([joint.acceleration_limit or np.inf for joint in joints]),
        jerk_limit=np.array([joint.jerk_limit or np.inf for joint in joints]),
        locked=locked,
        channels=None
        if description.recording is None
        else build_channels(
            description.recording,
            source,
            names,
            prismatic=prismatic,
            reduction=[float(value) for value in reduction],
            has_gain=["effort_gain" in joint.model_fields_set for joint in joints],
        ),
        notes=notes,
    )


def _movable(tree: ElementTree.Element) -> list[str]:
    return [joint.get("name", "") for joint in tree.findall("joint") if joint.get("type") in MOVABLE]


def _identified_joints(
    description: RobotDescription, coupled: Mapping[str, Follower], tree: ElementTree.Element, source: Path
) -> tuple[list[str], tuple[str, ...]]:
    movable = _movable(tree)
    notes = []
    if description.joints is None:
        gripper = [name for name in movable if name in {*coupled, *coupled_ends(tree, coupled, movable)}]
        names = [name for name in movable if name not in {*description.locked, *gripper}]
        if gripper:
            more = f" and {len(gripper) - 4} more" if len(gripper) > 5 else ""
            shown = gripper[:4] if more else gripper
            notes.append(f"{', '.join(shown)}{more}: coupled (mimic) and carry no other joint: they are locked")
        if source.suffix.lower() != ".yaml" and source == embedded_urdf():
            names = ["joint1", "joint2"]
    else:
        names = list(description.joints)
    for key, given in (("joints", names), ("locked", list(description.locked))):
        for name in given:
            if name not in movable:
                raise RobotError(f"{source}: {key}.{name}: {_unknown_joint(name, movable, tree)}")
    for name in description.locked:
        if name in names:
            raise RobotError(f"{source}: locked.{name}: the joint is also under joints; name it in one of them")
    if not names:
        raise RobotError(f"{source}: joints: none to identify; {description.urdf} has {_listed(movable)}")
    kinds = {joint.get("name", ""): joint.get("type") for joint in tree.findall("joint")}
    for name, kind in kinds.items():
        if kind not in (*MOVABLE, "fixed"):
            raise RobotError(
                f"{description.urdf}: joint {name} is of type {kind}; revolute, continuous, prismatic "
                "and fixed joints are supported"
            )
    refuse_coupled(names, coupled, source)
    return names, tuple(notes)


def _unknown_joint(name: str, movable: Sequence[str], tree: ElementTree.Element) -> str:
    everything = {joint.get("name"): joint.get("type") for joint in tree.findall("joint")}
    if name in everything:
        return f"a {everything[name]} joint cannot be identified; the movable joints are {_listed(movable)}"
    lower = {other.lower(): other for other in movable}
    near = get_close_matches(name.lower(), lower, n=1)
    hint = f"did you mean {lower[near[0]]}?" if near else f"it has {_listed(movable)}"
    return f"the URDF has no such joint; {hint}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "no movable joint"


def _lock(
    model: pin.Model, names: Sequence[str], description: RobotDescription, source: Path
) -> tuple[pin.Model, tuple[tuple[str, float], ...]]:
    reference = pin.neutral(model)
    locked: list[tuple[str, float]] = []
    ids: list[int] = []
    for joint_id in range(1, model.njoints):
        name = model.names[joint_id]
        if name in names:
            continue
        value = float(description.locked.get(name, 0.0))
        joint = model.joints[joint_id]
        if joint.nq == 1:
            reference[joint.idx_q] = value
        else:
            reference[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        locked.append((name, value))
        ids.append(joint_id)
    try:
        reduced = pin.buildReducedModel(model, ids, reference) if ids else model
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise RobotError(
            f"{description.urdf}: cannot lock {', '.join(name for name, _ in locked)}: {reason}; "
            "a joint and a link may have the same name"
        ) from None
    for joint_id in range(1, reduced.njoints):
        if reduced.joints[joint_id].nv != 1:
            raise RobotError(f"{source}: joints.{reduced.names[joint_id]}: has more than one degree of freedom")
    return reduced, tuple(locked)


def _moved_link(model: pin.Model, joint_id: int) -> str:
    frame = model.getFrameId(model.names[joint_id], pin.FrameType.JOINT)
    for body in model.frames:
        if body.type == pin.FrameType.BODY and body.parentFrame == frame:
            return str(body.name)
    return str(model.names[joint_id])
