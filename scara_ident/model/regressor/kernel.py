"""Pinocchio's joint-torque regressor for a whole recording at once.

The recursion is traced once for a model and emitted as straight-line vector code, which is then checked against
Pinocchio on random states whenever it is built: Pinocchio stays the truth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from scara_ident.arrays import Array, runs_of
from scara_ident.errors import RegressorMismatch
from scara_ident.manners import Frozen
from scara_ident.model.regressor.program import Program
from scara_ident.model.regressor.recursion import JointGeometry, joint_geometry, trace_regressor
from scara_ident.model.regressor.tracing import compile_program
from scara_ident.threads import LONG_ARRAY, THREADS, side_by_side, works_alone

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
"""Standard parameters of a body in Pinocchio's order; the inertia is about the origin of the joint's frame."""

_KINDS = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
"""Mass, first moment, inertia: parameters whose columns have one unit."""
_CHUNK = 32768
"""Samples at a time: few enough for the shared cache, enough to hide the cost of a call.

And so many that two threads seldom wait for the interpreter's lock, which every operation takes: of 4096 samples each two
recordings side by side took half as long again as one after the other, of these they take two thirds.
"""
_TOLERANCE = 1e-10
_SMALLEST_SCALE = 1e-3
_ROUNDING = 1e-9
"""Entries of this size, at speeds and accelerations of order 10, are rounding."""
_STATES = 48


@dataclass(frozen=True, eq=False, repr=False)
class RegressorKernel(Frozen):
    """The joint-torque regressor of one model, evaluated over vectors of samples.

    It is for the joint side, without rotor inertia and reductions, in Pinocchio's velocity order.

    Attributes
    ----------
    nv : int
        Number of joints.
    columns : ndarray of intp (p,)
        Standard parameters of the columns: 10 per body, bodies in Pinocchio's order, within a body in the order of
        `PARAMETERS`.
    pattern : ndarray of bool (nv, p)
        False if the entry is zero for every state.
    """

    nv: int
    columns: NDArray[np.intp]
    pattern: NDArray[np.bool_]
    _program: Program = field(repr=False)

    def __call__(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: Array | None = None) -> Array:
        """Evaluate the regressor.

        Parameters
        ----------
        q, v, a : array_like (nv, samples)
            Joint positions (the angle itself for a continuous joint), velocities and accelerations;
            rad or m, and per s and s^2. Arrays of recorded expressions are evaluated too, into expressions.
        out : ndarray (nv, p, samples), optional
            Where to write; also the first samples of a longer array in C order, ``buffer[:, :, :samples]``.

        Returns
        -------
        ndarray (nv, p, samples)
            `out` if given. In C order; the torque of sample k is ``result[:, :, k] @ parameters``, N m or N.

        Raises
        ------
        ValueError
            An array has the wrong shape, or `out` is not of floats in C order.
        """
        states = self._states(q, v, a)
        samples = states.shape[1]
        shape = (self.nv, len(self.columns), samples)
        zeros: list[slice] = []
        if out is None:
            out = np.zeros(shape, dtype=states.dtype)
        else:
            zeros = [slice(*run) for run in runs_of(~self.pattern.ravel())]
        rows = _flat(out, shape)
        program = self._program
        buffers = np.empty((program.buffers, min(_CHUNK, samples)), dtype=states.dtype)
        for start in range(0, samples, _CHUNK):
            stop = min(start + _CHUNK, samples)
            target = rows[:, start:stop]
            for run in zeros:
                target[run] = 0.0
            program.evaluate(states[:, start:stop], target, buffers[:, : stop - start])
        return out

    def fill(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, targets: Mapping[int, Array]) -> None:
        """Evaluate the entries that are not zero for every state, each into its own vector.

        Parameters
        ----------
        q, v, a : array_like (nv, samples)
            As for a call.
        targets : mapping of int to ndarray (samples,)
            Where to write the entry of row r and column k, at ``r p + k``, for all that `pattern` holds.
        """
        states = [row for part in self._parts(q, v, a) for row in part]
        samples = len(states[0])
        count = max(1, -(-samples // _CHUNK))
        if not works_alone() and samples >= THREADS * LONG_ARRAY:
            count = THREADS * -(-count // THREADS)
        # Equal chunks, so that the last is not a short one.
        length = max(1, -(-samples // count))

        def chunk(start: int) -> None:
            some = slice(start, start + length)
            parts = {place: target[some] for place, target in targets.items()}
            own = [row[some] for row in states]
            self._program.evaluate(own, parts, np.empty((self._program.buffers, len(own[0]))))

        side_by_side(chunk, range(0, samples, length))

    def _states(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Return the three inputs as one array (3 nv, samples)."""
        return np.concatenate(self._parts(q, v, a))

    def _parts(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> list[Array]:
        """Return the three inputs as arrays (nv, samples)."""
        traced = any(np.asarray(values).dtype == object for values in (q, v, a))
        parts = [np.asarray(values, dtype=object if traced else np.float64) for values in (q, v, a)]
        for name, part in zip("qva", parts, strict=True):
            if part.ndim != 2 or part.shape[0] != self.nv or part.shape != parts[0].shape:
                shapes = ", ".join(str(part.shape) for part in parts)
                raise ValueError(f"{name}: expected ({self.nv}, samples), the same for q, v and a; given {shapes}")
        return parts


def build_kernel(model: pin.Model, columns: Sequence[int] | NDArray[np.intp] | None = None) -> RegressorKernel:
    """Trace, generate and check the regressor of a model, once for all models with the same joints and gravity.

    Parameters
    ----------
    model : pin.Model
        Revolute, continuous and prismatic joints, in a chain or a tree; its gravity is used.
    columns : sequence of int, optional
        Standard parameters whose columns are computed, each in 0 .. 10 nbodies - 1; all by default.

    Returns
    -------
    RegressorKernel

    Raises
    ------
    RobotError
        If the model has a joint of another kind.
    RegressorMismatch
        If the kernel does not reproduce Pinocchio's regressor.
    ValueError
        If a column does not exist.
    """
    joints = joint_geometry(model)
    parts = [(item.axis.tobytes(), item.rotation.tobytes(), item.offset.tobytes()) for item in joints]
    rows = [(item.parent, item.velocity_index, item.prismatic) for item in joints]
    wanted = np.arange(10 * len(joints)) if columns is None else np.array(columns, dtype=np.intp)
    words = (*rows, *parts, model.gravity.vector.tobytes(), wanted.shape, wanted.tobytes())
    return _checked_kernel(_Asked(words, model, tuple(joints), wanted))


@dataclass(frozen=True)
class _Asked:
    """A kernel of a model; `words` say all that it follows from, so that it is that of every model alike."""

    words: tuple[object, ...]
    model: pin.Model = field(compare=False)
    joints: tuple[JointGeometry, ...] = field(compare=False)
    columns: NDArray[np.intp] = field(compare=False)


@lru_cache(maxsize=32)
def _checked_kernel(asked: _Asked) -> RegressorKernel:
    kernel = _emit_kernel(asked.joints, asked.model.gravity, asked.columns)
    _check(kernel, asked.model)
    return kernel


def pinocchio_regressor(model: pin.Model, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
    """Loop over ``pin.computeJointTorqueRegressor``: slow, and the truth.

    Parameters
    ----------
    q, v, a : array_like (nv, samples)
        As for `RegressorKernel`: one angle for a continuous joint too.
    """
    v, a = np.asarray(v, dtype=np.float64), np.asarray(a, dtype=np.float64)
    full = configurations(model, np.asarray(q, dtype=np.float64))
    data = model.createData()
    result = np.empty((v.shape[1], model.nv, 10 * (model.njoints - 1)))
    for k in range(v.shape[1]):
        result[k] = pin.computeJointTorqueRegressor(model, data, full[:, k], v[:, k], a[:, k])
    return np.ascontiguousarray(np.moveaxis(result, 0, -1))


def _emit_kernel(
    joints: Sequence[JointGeometry], gravity: pin.Motion, columns: Sequence[int] | NDArray[np.intp] | None
) -> RegressorKernel:
    nv, width = len(joints), 10 * len(joints)
    wanted = np.arange(width) if columns is None else np.array(columns, dtype=np.intp)
    if wanted.ndim != 1 or np.any((wanted < 0) | (wanted >= width)):
        raise ValueError(f"columns: expected standard parameters in 0 .. {width - 1}, given {columns}")
    trace, entries = trace_regressor(joints, gravity, sorted(set(wanted.tolist())))
    pattern = np.zeros((nv, len(wanted)), dtype=np.bool_)
    outputs = []
    # Body by body, so that what a body needs is used while it is in the cache.
    for place in np.argsort(wanted // 10, kind="stable").tolist():
        for row in range(nv):
            entry = entries.get((row, int(wanted[place])))
            if entry is not None:
                pattern[row, place] = True
                outputs.append((row * len(wanted) + place, entry))
    for array in (wanted, pattern):
        array.flags.writeable = False
    return RegressorKernel(nv, wanted, pattern, compile_program(trace, outputs))


def _check(kernel: RegressorKernel, model: pin.Model) -> None:
    """Compare a kernel with Pinocchio on random states.

    The states spread over several turns or metres. A difference counts relative to the largest entry of its column,
    but at least to a thousandth of the largest of all columns of its unit (of 1 where these are all zero, as the
    inertias of a single slide): a column that is zero but for rounding has no digits to agree in.
    """
    generator = np.random.default_rng(20020)
    q, v, a = (generator.uniform(-bound, bound, (kernel.nv, _STATES)) for bound in (10.0, 3.0, 10.0))
    everything = pinocchio_regressor(model, q, v, a)
    largest = np.abs(everything).max(axis=(0, 2))
    kinds = np.tile(_KINDS, model.njoints - 1)
    for kind in range(3):
        same = kinds == kind
        size = largest[same].max()
        largest[same] = np.maximum(largest[same], _SMALLEST_SCALE * (size if size > _ROUNDING else 1.0))
    difference = np.abs(kernel(q, v, a) - everything[:, kernel.columns]).max(axis=2)
    relative = difference / largest[kernel.columns]
    relative[np.isnan(relative)] = np.inf
    if relative.max(initial=0.0) > _TOLERANCE:
        row, place = np.unravel_index(np.argmax(relative), relative.shape)
        body, parameter = divmod(int(kernel.columns[place]), 10)
        names = list(model.names)[1:]
        by_row = {joint.idx_v: names[k] for k, joint in enumerate(list(model.joints)[1:])}
        raise RegressorMismatch(
            f"{model.name}: the regressor of joint '{by_row[int(row)]}' for {PARAMETERS[parameter]} of body "
            f"'{names[body]}' differs from Pinocchio's by {relative[row, place]:.1e} relative "
            f"(at most {_TOLERANCE:.0e} is accepted); please report this robot"
        )


def configurations(model: pin.Model, q: Array) -> Array:
    """Return Pinocchio's configurations (nq, samples): cosine and sine of the angle of a continuous joint."""
    result = np.empty((model.nq, q.shape[1]))
    for joint in list(model.joints)[1:]:
        if joint.nq == 2:
            result[joint.idx_q] = np.cos(q[joint.idx_v])
            result[joint.idx_q + 1] = np.sin(q[joint.idx_v])
        else:
            result[joint.idx_q] = q[joint.idx_v]
    return result


def _flat(out: Array, shape: tuple[int, int, int]) -> Array:
    """Return a view (nv p, samples) of an array (nv, p, samples)."""
    if out.shape != shape or out.dtype not in (np.float64, np.object_):
        raise ValueError(f"out: expected {shape} of float64, given {out.shape} of {out.dtype}")
    rows = out.reshape(shape[0] * shape[1], shape[2])
    if out.size and not np.may_share_memory(rows, out):
        raise ValueError("out: expected an array in C order, or the first samples of one")
    return rows
