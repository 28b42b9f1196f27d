"""Bodies: from standard parameters to masses, and from one rigid body to the links it is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import ScaraIdentError
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.robot.robot import Robot

# A pseudo-inertia counts as positive semidefinite down to this share of its trace: what a conic solver leaves.
CONSISTENCY_TOLERANCE = 1e-9
# Nominal bodies thinner than this share of their size cannot be reshaped into another body.
FLATNESS = 1e-10


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body about its centre of mass.

    Attributes
    ----------
    mass : float
        kg.
    com : ndarray, shape (3,)
        Centre of mass in the body's frame, m.
    inertia : ndarray, shape (3, 3)
        About the centre of mass in the axes of the body's frame, kg m^2.
    """

    mass: float
    com: Array
    inertia: Array


def body_about_com(parameters: Array) -> Body:
    """Return mass, centre of mass and inertia of a body's ten parameters, in Pinocchio's order."""
    mass = float(parameters[0])
    ixx, ixy, iyy, ixz, iyz, izz = (float(value) for value in parameters[4:])
    about_frame = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if mass <= 0.0:
        return Body(0.0, np.zeros(3), about_frame)
    com = np.asarray(parameters[1:4], dtype=float) / mass
    return Body(mass, com, about_frame - mass * (com @ com * np.eye(3) - np.outer(com, com)))


def body_parameters(body: Body) -> Array:
    """Return the ten parameters of a body, the inverse of `body_about_com`."""
    return np.asarray(pin.Inertia(body.mass, body.com, body.inertia).toDynamicParameters())


def check_standard(robot: Robot, standard: Array) -> tuple[Array, Array]:
    """Split standard parameters into bodies and armatures, if they are those of an arm that can exist.

    Parameters
    ----------
    standard : ndarray, shape (11 n,)
        See `Robot.standard_parameters`.

    Returns
    -------
    bodies : ndarray, shape (n, 10)
        The bodies' parameters in the order of ``robot.joints``.
    armature : ndarray, shape (n,)
        Never negative; what a solver leaves below zero is cut off.

    Raises
    ------
    ScaraIdentError
        In one line, with the link or joint and what is impossible about it.

    References
    ----------
    P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial
    parameter identification", IEEE Robotics and Automation Letters 3(1), 2018.
    """
    standard = np.asarray(standard, dtype=float)
    if standard.shape != (11 * robot.n,):
        raise ValueError(f"standard parameters have shape {standard.shape}; expected ({11 * robot.n},)")
    bodies = standard[: 10 * robot.n].reshape(robot.n, 10)
    advice = f"no real link has it; estimate with {asked_for('--method consistent')}"
    for link, body in zip(robot.links, bodies, strict=True):
        if not np.all(np.isfinite(body)):
            raise ScaraIdentError(f"{link}: its inertial parameters are not all finite; nothing can be exported")
        pseudo = pseudo_inertia(body)
        allowed = CONSISTENCY_TOLERANCE * float(np.abs(np.diag(pseudo)).sum())
        smallest = float(np.linalg.eigvalsh(pseudo)[0])
        if body[0] < -allowed:
            raise ScaraIdentError(f"{link}: its mass is {body[0]:.6g} kg; {advice}")
        if body[0] <= 0.0 and float(np.linalg.norm(body[1:4])) > allowed:
            raise ScaraIdentError(f"{link}: it has a first moment of mass but no mass; {advice}")
        if smallest < -allowed:
            raise ScaraIdentError(
                f"{link}: its pseudo-inertia has the eigenvalue {smallest:.6g}, of a trace of "
                f"{np.trace(pseudo):.6g}; {advice}"
            )
    armature = standard[10 * robot.n :]
    for joint, value in zip(robot.joints, armature, strict=True):
        # Not the other way round: NaN has to end here too.
        if not value >= -CONSISTENCY_TOLERANCE * float(np.max(np.abs(armature))):
            raise ScaraIdentError(f"{joint}: its armature is {value:.6g}; {advice.replace('link', 'rotor')}")
    return bodies, np.maximum(armature, 0.0)


@dataclass(frozen=True, eq=False)
class Member:
    """A link of a rigid body.

    Attributes
    ----------
    placement : pinocchio.SE3
        The link's frame in the frame of the joint that moves the body.
    parameters : ndarray, shape (10,)
        Nominal parameters in the link's frame; zeros where the URDF gives none.
    """

    link: str
    placement: pin.SE3
    parameters: Array

    @property
    def in_joint_frame(self) -> Array:
        """The ten parameters in the frame of the joint."""
        return _moved(self.placement, self.parameters)


def members_of(robot: Robot, joint: int, nominal: dict[str, Array]) -> tuple[Member, ...]:
    """Return the links of the body that joint ``joint`` moves, its own link first.

    ``nominal`` has the ten parameters of the links that have any.
    """
    moved = int(robot.order[joint]) + 1
    frames = [f for f in robot.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == moved]
    frames.sort(key=lambda f: f.name != robot.links[joint])
    return tuple(Member(f.name, pin.SE3(f.placement), nominal.get(f.name, np.zeros(10))) for f in frames)


def share(composite: Array, members: Sequence[Member]) -> tuple[tuple[Array, ...], str | None]:
    """Share a rigid body among its links.

    The carried links keep their nominal inertia if what remains for the moving link can exist. Else every link
    is scaled in mass and reshaped by the one affine map that turns the nominal body into the identified one
    (the optimal transport between their mass distributions): a map of points, so it leaves every link possible.
    Where the nominal body has no such map the moving link gets everything.

    Parameters
    ----------
    composite : ndarray, shape (10,)
        The identified body in the frame of its joint.
    members : sequence of Member
        The moving link, whose frame is the joint's, then the links it carries.

    Returns
    -------
    parameters : tuple of ndarray, shape (10,)
        Of every link in its own frame; they add up to ``composite``.
    note : str or None
        What happened, unless the carried links kept theirs.
    """
    carried = [member.in_joint_frame for member in members[1:]]
    if not any(np.any(part) for part in carried):
        return (composite, *(member.parameters for member in members[1:])), None
    remainder = composite - np.sum(carried, axis=0)
    possible = all(_is_body(member.parameters) for member in members)
    if possible and remainder[0] > 0.0 and np.linalg.eigvalsh(pseudo_inertia(remainder))[0] >= 0.0:
        return (remainder, *(member.parameters for member in members[1:])), None
    names = ", ".join(member.link for member in members[1:] if np.any(member.parameters))
    first = members[0].link
    reason = f"{first}: after subtracting the nominal {names} the rest of the identified body is no possible link"
    parts = _transport(composite, [member.in_joint_frame for member in members]) if possible else None
    if parts is None:
        alone = tuple(np.zeros(10) for _ in members[1:])
        return (composite, *alone), f"{reason}; {first} holds all of it and {names} none"
    own = tuple(_moved(member.placement.inverse(), part) for member, part in zip(members, parts, strict=True))
    scale = composite[0] / np.sum([member.parameters[0] for member in members])
    return own, f"{reason}; all were scaled to {scale:.6g} of their nominal mass and reshaped alike"


def _moved(placement: pin.SE3, parameters: Array) -> Array:
    if not np.any(parameters):
        return parameters
    homogeneous = np.asarray(placement.homogeneous)
    return _parameters(homogeneous @ pseudo_inertia(parameters) @ homogeneous.T)


def _parameters(pseudo: Array) -> Array:
    symmetric = (pseudo + pseudo.T) / 2.0
    return np.asarray(pin.PseudoInertia.FromMatrix(symmetric).toDynamicParameters())


def _is_body(parameters: Array) -> bool:
    pseudo = pseudo_inertia(parameters)
    smallest = float(np.linalg.eigvalsh(pseudo)[0])
    return parameters[0] >= 0.0 and smallest >= -CONSISTENCY_TOLERANCE * float(np.abs(np.diag(pseudo)).sum())


def _transport(composite: Array, parts: Sequence[Array]) -> list[Array] | None:
    """Carry parts along the map from their sum to another body, all in one frame; None where there is no map."""
    whole, target = pseudo_inertia(np.sum(parts, axis=0)), pseudo_inertia(composite)
    if whole[3, 3] <= 0.0 or target[3, 3] <= 0.0:
        return None
    centre, spread = _moments(whole)
    new_centre, new_spread = _moments(target)
    widths = np.linalg.eigvalsh(spread)
    if widths[0] <= FLATNESS * widths[2]:
        return None
    root = _root(spread)
    inverse = np.linalg.inv(root)
    stretch = inverse @ _root(root @ new_spread @ root) @ inverse
    density = np.sqrt(target[3, 3] / whole[3, 3])
    affine = np.eye(4)
    affine[:3, :3] = stretch
    affine[:3, 3] = new_centre - stretch @ centre
    affine *= density
    moved = [_parameters(affine @ pseudo_inertia(part) @ affine.T) if np.any(part) else part for part in parts]
    # The heaviest takes what rounding leaves, so that the sum is the identified body.
    heaviest = int(np.argmax([part[0] for part in parts]))
    moved[heaviest] = composite - np.sum([part for k, part in enumerate(moved) if k != heaviest], axis=0)
    return moved


def _moments(pseudo: Array) -> tuple[Array, Array]:
    """Centre and covariance of a body's mass."""
    centre = pseudo[:3, 3] / pseudo[3, 3]
    return centre, pseudo[:3, :3] / pseudo[3, 3] - np.outer(centre, centre)


def _root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2.0)
    return np.asarray((vectors * np.sqrt(np.clip(values, 0.0, None))) @ vectors.T)
