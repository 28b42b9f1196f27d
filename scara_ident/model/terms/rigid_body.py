"""The rigid bodies and the rotors, seen through the base parameters."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.base_parameters import BaseParameters, find_base_parameters
from scara_ident.model.regressor.derivative import derivative, gradient
from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
from scara_ident.model.regressor.program import Program
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.tracing import Expr, Scalar, Trace, compile_program
from scara_ident.model.regressor.vectors import floats
from scara_ident.model.terms.constraints import Constraint, RealBodies
from scara_ident.model.terms.term import Column, Filled, StateTorque
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

# Samples at a time where columns are not kept: few enough for the cache.
CHUNK = 8192
_RECORDING = threading.Lock()
# Mass of a body for which any will do, kg.
SPECK = 1e-3
# The SCARA of Indri et al. 2002 and its P_d (equation 2), recognised by what the reduction finds.
_SCARA_LEADS = ("I1zz", "mx2", "my2", "I2zz", "Ia2")
_SCARA_MEANINGS = ("I1z + m2 l1^2 + Jm1/tau1^2", "m2 s2x", "m2 s2y", "I2z", "Jm2/tau2^2")


@dataclass(frozen=True, eq=False)
class RigidBody(Filled):
    """Inertia, Coriolis and gravity torques of the links and the inertia of the rotors.

    Attributes
    ----------
    robot : Robot
    base : BaseParameters
        The reduction; its base parameters are the columns.
    kept : ndarray of int
        Which of the base parameters are columns of the model.
    columns : tuple of Column
    pattern : ndarray of bool, shape (n, p)
    kernel : RegressorKernel or None
        Generates the columns led by link parameters; None where there are none.
    """

    robot: Robot
    base: BaseParameters
    kept: NDArray[np.intp]
    columns: tuple[Column, ...]
    pattern: NDArray[np.bool_]
    kernel: RegressorKernel | None

    @property
    def name(self) -> str:
        """Name of the term."""
        return "rigid_body"

    def constraints(self) -> tuple[Constraint, ...]:
        """Return that the columns belong to bodies that can exist."""
        return (RealBodies(),)

    def fill(self, motion: Motion, rows: Sequence[Array]) -> None:
        """Write the columns that links and rotors lead."""
        robot = self.robot
        if self.kernel is not None:
            states = (motion.q, motion.v, motion.a)
            if np.any(robot.order != np.arange(robot.n)):
                back = np.argsort(robot.order)
                states = (motion.q[back], motion.v[back], motion.a[back])
            self.kernel.fill(*states, {entry: rows[joint][place] for entry, joint, place in self._targets})
        for joint, place in self._rotors:
            rows[joint][place] = motion.a[joint]
        for joint, scale in enumerate(robot.row_scale):
            if scale != 1.0:
                np.multiply(rows[joint], scale, out=rows[joint])

    @cached_property
    def _targets(self) -> list[tuple[int, int, int]]:
        """Entry of the kernel, joint, and place among the joint's columns."""
        if self.kernel is None:
            return []
        order, place = self.robot.order, np.cumsum(self.pattern, axis=1) - 1
        links, _ = _split(self.base.kept[self.kept], self.robot.n)
        inner = np.argwhere(self.kernel.pattern[order])
        return [(int(order[j]) * len(links) + int(k), int(j), int(place[j, links[k]])) for j, k in inner]

    @cached_property
    def _rotors(self) -> list[tuple[int, int]]:
        """Joint and place among its columns of those that rotors lead."""
        place = np.cumsum(self.pattern, axis=1) - 1
        standard = self.base.kept[self.kept]
        _, rotors = _split(standard, self.robot.n)
        joints = [int(standard[column]) - 10 * self.robot.n for column in rotors]
        return [(joint, int(place[joint, column])) for joint, column in zip(joints, rotors, strict=True)]

    def torque(self, motion: Motion, value: Array) -> Array:
        """Return the torque of parameters ``value`` (p,) on a motion, shape (n, N), without keeping any column."""
        bodies, armature = self._standard(value)
        result = np.empty((self.robot.n, motion.samples))
        _evaluate(self._program, motion, bodies, result)
        result += armature[:, None] * motion.a
        result *= self.robot.row_scale[:, None]
        return result

    def slopes(self, motion: Motion, value: Array, joint: int) -> Array:
        """Return the derivatives of `torque` by the position, velocity and acceleration of one joint, shape (3, n, N)."""
        bodies, armature = self._standard(value)
        result = np.empty((3, self.robot.n, motion.samples))
        _evaluate(self._slope_program(joint), motion, bodies, result.reshape(-1, motion.samples))
        result[2, joint] += armature[joint]
        result *= self.robot.row_scale[:, None]
        return result

    @cached_property
    def _traced(self) -> tuple[Trace, list[list[Expr]], list[Scalar]]:
        """The torque of the links, by joint, of positions, velocities and accelerations, by joint, and of bodies, as in `_standard`."""
        robot, trace, back = self.robot, Trace(), np.argsort(self.robot.order)
        states = [[trace.variable(j + part * robot.n) for j in range(robot.n)] for part in range(3)]
        q, v, a = ([part[j] for j in back] for part in states)
        used = self._standard(np.ones(len(self.kept)))[0] != 0.0
        bodies = [trace.variable(3 * robot.n + k) if one else 0.0 for k, one in enumerate(used.tolist())]
        rows = [bodies[k : k + 10] for k in range(0, len(bodies), 10)]
        torque = trace_torque(joint_geometry(robot.model), floats(robot.model.gravity.linear), rows, q, v, a)
        return trace, states, [torque[int(place)] for place in robot.order]

    @cached_property
    def _program(self) -> Program:
        trace, _, torque = self._traced
        return compile_program(trace, list(enumerate(torque)))

    def _slope_program(self, joint: int) -> Program:
        """The derivatives of the links' torque by the position, velocity and acceleration of one joint, one after the other."""
        # Recording what another thread records too would mix them up.
        with _RECORDING:
            if joint not in self._slope_programs:
                trace, states, torque = self._traced
                slopes = [slope for part in states for slope in derivative(torque, part[joint])]
                self._slope_programs[joint] = compile_program(trace, list(enumerate(slopes)))
            return self._slope_programs[joint]

    @cached_property
    def _slope_programs(self) -> dict[int, Program]:
        return {}

    def pulled_back(self, motion: Motion, weights: Array) -> Array:
        """Differentiate ``sum_ij G_ij W_ij`` of the columns W by the motion, backwards through their arithmetic.

        Parameters
        ----------
        motion : Motion
            N samples.
        weights : ndarray, shape (n, p, N)
            G.

        Returns
        -------
        ndarray, shape (3, n, N)
            By position, velocity and acceleration of each joint.
        """
        robot = self.robot
        scaled = weights * robot.row_scale[:, None, None]
        result = np.zeros((3, robot.n, motion.samples))
        links, rotors = _split(self.base.kept[self.kept], robot.n)
        if self.kernel is not None:
            back = np.argsort(robot.order)
            states = np.concatenate([motion.q[back], motion.v[back], motion.a[back]])
            seeds = scaled[back][:, links].reshape(-1, motion.samples)
            program = self._adjoint
            found = np.zeros((3 * robot.n, motion.samples))
            program.evaluate([*states, *seeds], found, np.empty((program.buffers, motion.samples)))
            result += found.reshape(3, robot.n, -1)[:, robot.order]
        for column in rotors:
            joint = int(self.base.kept[self.kept][column]) - 10 * robot.n
            result[2, joint] += scaled[joint, column]
        return result

    def torque_slopes(self, motion: Motion, value: Array) -> Array:
        """Differentiate the torque of parameters ``value`` (p,) by the motion, with Pinocchio.

        Parameters
        ----------
        motion : Motion
            N samples.
        value : ndarray, shape (p,)

        Returns
        -------
        ndarray, shape (n, 3, n, N)
            Of every joint, by position, velocity and acceleration of each.

        References
        ----------
        J. Carpentier, N. Mansard, "Analytical derivatives of rigid body dynamics algorithms", RSS 2018.
        """
        masses = np.isin(self.base.kept[self.kept], np.arange(0, 10 * self.robot.n, 10))
        if np.any(value[masses] <= SPECK * self.robot.n):
            # Pinocchio's bodies have a mass; torque is linear in it.
            more = masses * (1.0 - value[masses].min())
            return self.torque_slopes(motion, value + more) - self.torque_slopes(motion, more)
        robot, order = self.robot, self.robot.order
        back = np.argsort(order)
        model, armature = self._arm(value)
        data, turning = model.createData(), _turning(model)
        slopes = np.empty((motion.samples, 3, robot.n, robot.n))
        # Views of what Pinocchio writes for every sample; to ask for them each time takes a third as long as what it does.
        held = (data.dtau_dq, data.dtau_dv, data.M)
        for q, v, a, slope in zip(motion.q[back].T, motion.v[back].T, motion.a[back].T, slopes, strict=True):
            pin.computeRNEADerivatives(model, data, _configuration(model, q, turning) if turning else q, v, a)
            slope[0], slope[1], slope[2] = held
        found = slopes[:, :, order[:, None], order].transpose(2, 1, 3, 0)
        found[np.arange(robot.n), 2, np.arange(robot.n)] += armature[:, None]
        return np.asarray(found * robot.row_scale[:, None, None, None])

    def _arm(self, value: Array) -> tuple[pin.Model, Array]:
        """Return an arm whose torque is that of parameters ``value`` (p,), each body with a mass, and its armatures."""
        n, back, model = self.robot.n, np.argsort(self.robot.order), self.robot.model.copy()
        standard, lead = self.standard(value), self.base.kept
        masses = np.setdiff1d(np.arange(0, 10 * n, 10), lead)
        standard[masses] = SPECK
        # What leads makes up for it.
        standard[lead] -= SPECK * self.base.grouping[:, masses].sum(axis=1)
        for k, body in enumerate(standard[: 10 * n].reshape(n, 10)[back], 1):
            model.inertias[k] = pin.Inertia.FromDynamicParameters(body)
        model.armature = np.zeros(n)
        return model, standard[10 * n :]

    @cached_property
    def _adjoint(self) -> Program:
        """The gradient of the kernel's weighted sum by its states; weights follow these, row by row."""
        assert self.kernel is not None
        trace, inputs = Trace(), 3 * self.robot.n
        states = [trace.variable(k) for k in range(inputs)]
        q, v, a = np.array(states, dtype=object).reshape(3, -1, 1)
        entries = self.kernel(q, v, a).ravel().tolist()
        seeds = [trace.variable(inputs + k) for k in range(len(entries))]
        return compile_program(trace, list(enumerate(gradient(entries, seeds, states))))

    def standard(self, value: Array) -> Array:
        """Return standard parameters that have the base parameters ``value``, shape (11 n,): each stands for the one that leads it."""
        standard = np.zeros(11 * self.robot.n)
        standard[self.base.kept[self.kept]] = value
        return standard

    def _standard(self, value: Array) -> tuple[Array, Array]:
        """Return the bodies' parameters, in Pinocchio's order, and the armatures, at the joints; what does not lead is zero."""
        n, standard = self.robot.n, self.standard(value)
        return standard[: 10 * n].reshape(-1, 10)[np.argsort(self.robot.order)].ravel(), standard[10 * n :]

    def state_torque(self, value: Array) -> StateTorque:
        """Return the torque in one state: Pinocchio's regressor times the parameters that lead the columns.

        Those that do not lead are zero, as `find_base_parameters` has it: no torque depends on which they are.
        """
        robot, model, order = self.robot, self.robot.model, self.robot.order
        bodies, armature = self._standard(value)
        armature = armature * robot.row_scale
        back, same_side = np.argsort(order), bool(np.all(robot.row_scale == 1.0))
        scale = robot.row_scale
        plain = bool(np.all(order == np.arange(robot.n)))
        turning = _turning(model)
        own = threading.local()  # Pinocchio writes into its data, which two threads cannot share.

        def torque(q: Array, v: Array, a: Array) -> Array:
            data = getattr(own, "data", None)
            if data is None:
                data = own.data = model.createData()
            p, w, z = (q, v, a) if plain else (q[back], v[back], a[back])
            full = _configuration(model, p, turning) if turning else p
            found = pin.computeJointTorqueRegressor(model, data, full, w, z).dot(bodies)
            if not plain:
                found = found[order]
            return np.asarray((found if same_side else scale * found) + armature * a)

        return torque


def _evaluate(program: Program, motion: Motion, bodies: Array, result: Array) -> None:
    """Evaluate a program of states and bodies into rows over the samples of a motion."""
    numbers = list(map(np.asarray, bodies))
    buffers = np.empty((program.buffers, min(CHUNK, motion.samples)))
    for start in range(0, motion.samples, CHUNK):
        some = slice(start, start + CHUNK)
        states = [row[some] for part in (motion.q, motion.v, motion.a) for row in part]
        targets = [row[some] for row in result]
        program.evaluate([*states, *numbers], targets, buffers[:, : len(targets[0])])


def _turning(model: pin.Model) -> list[tuple[int, int]]:
    """Return where the configuration and the velocities hold each continuous joint."""
    return [(joint.idx_q, joint.idx_v) for joint in list(model.joints)[1:] if joint.nq == 2]


def _configuration(model: pin.Model, q: Array, turning: Sequence[tuple[int, int]]) -> Array:
    """Return Pinocchio's configuration: cosine and sine of the angle of a continuous joint."""
    full = np.empty(model.nq)
    full[[joint.idx_q for joint in list(model.joints)[1:]]] = q
    for place, joint in turning:
        full[place], full[place + 1] = np.cos(q[joint]), np.sin(q[joint])
    return full


@lru_cache(maxsize=16)
def rigid_body(robot: Robot, *, without: tuple[str, ...] = ()) -> RigidBody:
    """Build the rigid-body term of a robot, once for each robot.

    Parameters
    ----------
    robot : Robot
    without : tuple of str, optional
        Columns to leave out, by name: parameters held to be zero.

    Raises
    ------
    RegressorMismatch
        If the batch kernel does not reproduce Pinocchio.
    """
    base = find_base_parameters(robot)
    names, meanings = _names(robot, base)
    kept = np.array([k for k in range(base.count) if names[k] not in without], dtype=np.intp)
    standard = base.kept[kept]
    links, _ = _split(standard, robot.n)
    # Standard parameters stand in the order of the description; the kernel wants Pinocchio's.
    in_pinocchio = [10 * int(robot.order[k // 10]) + int(k % 10) for k in standard[links]]
    kernel = build_kernel(robot.model, in_pinocchio) if in_pinocchio else None
    pattern = np.zeros((robot.n, len(kept)), dtype=bool)
    if kernel is not None:
        pattern[:, links] = kernel.pattern[robot.order]
    for place, k in enumerate(standard):
        if k >= 10 * robot.n:
            pattern[int(k) - 10 * robot.n, place] = True
    columns = tuple(
        Column(
            name=names[k],
            joint=_joint_of(robot, int(base.kept[k])),
            unit=base.units[k],
            meaning=meanings[k],
            nonnegative=_cannot_be_negative(base, k),
        )
        for k in kept
    )
    return RigidBody(robot, base, kept, columns, pattern, kernel)


def _split(standard: NDArray[np.intp], n: int) -> tuple[list[int], list[int]]:
    """Places of columns led by link parameters and by armatures."""
    links = [place for place, k in enumerate(standard) if k < 10 * n]
    return links, [place for place, k in enumerate(standard) if k >= 10 * n]


def _joint_of(robot: Robot, standard: int) -> str:
    return robot.joints[standard // 10 if standard < 10 * robot.n else standard - 10 * robot.n]


def _names(robot: Robot, base: BaseParameters) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if robot.name == "scara03" and base.names == _SCARA_LEADS:
        return tuple(f"P_d{i + 1}" for i in range(5)), _SCARA_MEANINGS
    return base.names, tuple(base.expression(k) for k in range(base.count))


def _cannot_be_negative(base: BaseParameters, index: int) -> bool:
    """Whether a base parameter is a sum with positive factors of masses, moments of inertia and armatures."""
    row = base.grouping[index]
    used = np.flatnonzero(row)
    positive = all(k >= 10 * len(base.reduction) or int(k) % 10 in (0, 4, 6, 9) for k in used)
    return positive and bool(np.all(row[used] > 0.0))
