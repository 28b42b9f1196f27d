"""Generalised momentum of the identified arm, and what changes it beside the drives."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.robot.robot import Robot

# Least mass that a body stands for, kg, and how much more than another parameter a mass is held to what is wanted: a body
# without mass has no centre of mass.
MIN_MASS, MASS_WEIGHT = 0.1, 1e3


@dataclass(frozen=True, eq=False)
class ArmMomentum:
    """Momentum ``p = M(q) v`` of links and rotors, at the joints.

    Attributes
    ----------
    model : pinocchio.Model
        Bodies that move as the identified arm; they need not be bodies that can exist.
    armature : ndarray, shape (n,)
        Of the rotors, in Pinocchio's order.
    order : ndarray of int, shape (n,)
        Velocity index of each joint.
    """

    model: pin.Model
    armature: Array
    order: NDArray[np.intp]
    _data: pin.Data = field(repr=False)
    _place: tuple[NDArray[np.intp], ...] = field(repr=False)

    @cached_property
    def _still(self) -> Array:
        return np.zeros(self.model.nv)

    def at(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the momentum and what changes it beside the drives, ``C(q, v)^T v - g(q)``, each of shape (n,).

        De Luca and Mattone, "Sensorless robot collision detection and hybrid force/motion control", ICRA 2005.

        Parameters
        ----------
        q, v : ndarray, shape (n,)
            In the robot's order.
        """
        model, data = self.model, self._data
        full, speed = self.configuration(q), v[self._place[0]]
        gravity = pin.computeGeneralizedGravity(model, data, full)
        momentum = pin.rnea(model, data, full, self._still, speed) + (self.armature * speed - gravity)
        change = speed @ pin.computeCoriolisMatrix(model, data, full, speed) - gravity
        return momentum[self.order], change[self.order]

    def configuration(self, q: Array) -> Array:
        """Return Pinocchio's configuration of joint positions in the robot's order."""
        back, plain, own, turning, circle = self._place
        angle = q[back]
        if len(turning) == 0:
            return np.asarray(angle)
        full = np.empty(self.model.nq)
        full[plain] = angle[own]
        full[circle], full[circle + 1] = np.cos(angle[turning]), np.sin(angle[turning])
        return full


def arm_momentum(known: IdentifiedModel) -> ArmMomentum:
    """Return the momentum of an identified arm.

    Of all standard parameters that have the identified base parameters those nearest to the URDF's are taken; torque,
    and so momentum, is the same for all of them (Gautier and Khalil, "Direct calculation of minimum set of inertial
    parameters of serial robots", 1990).
    """
    robot, body = known.robot, known.model.rigid_body
    base = np.zeros(body.base.count)
    base[body.kept] = known.value[known.model.place(body)]
    standard = _standard(robot, body.base.grouping, base)
    model = pin.Model(robot.model)
    for joint, row in enumerate(standard[: 10 * robot.n].reshape(robot.n, 10)):
        model.inertias[int(robot.order[joint]) + 1] = pin.Inertia.FromDynamicParameters(row)
    model.armature = np.zeros(model.nv)
    back = np.argsort(robot.order)
    return ArmMomentum(model, standard[10 * robot.n :][back], robot.order, model.createData(), _places(model, back))


def _standard(robot: Robot, grouping: Array, base: Array) -> Array:
    """Return standard parameters with given base parameters, near to the URDF's, with masses that are not 0."""
    wanted = robot.standard_parameters()
    wanted[: 10 * robot.n : 10] = np.maximum(wanted[: 10 * robot.n : 10], MIN_MASS)
    scale = np.ones(len(wanted))
    scale[: 10 * robot.n : 10] = 1.0 / MASS_WEIGHT
    step = scale * np.linalg.lstsq(grouping * scale, base - grouping @ wanted, rcond=None)[0]
    return np.asarray(wanted + step)


def _places(model: pin.Model, back: NDArray[np.intp]) -> tuple[NDArray[np.intp], ...]:
    """Return where joints stand in a configuration: those of one number, and those that turn without end."""
    joints = list(model.joints)[1:]
    plain = [(joint.idx_q, joint.idx_v) for joint in joints if joint.nq == 1]
    circle = [(joint.idx_q, joint.idx_v) for joint in joints if joint.nq == 2]
    pairs = [np.array(found, dtype=np.intp).reshape(-1, 2) for found in (plain, circle)]
    return back, pairs[0][:, 0], pairs[0][:, 1], pairs[1][:, 1], pairs[1][:, 0]
