"""An identified model as recorded arithmetic: torque by position, velocity and acceleration, and its parts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm, Scene, Signals
from scara_ident.model.model import TorqueModel
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.tracing import Expr, Scalar, Trace
from scara_ident.model.regressor.vectors import ZERO, Vector, floats
from scara_ident.model.terms import RigidBody, Term
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

NOT_OF_STATE = "it does not follow from position, velocity and acceleration at the moment"


@dataclass(frozen=True, eq=False)
class TracedModel:
    """A model with its parameters as recorded arithmetic, all torques on the recorded side.

    Attributes
    ----------
    robot : Robot
    trace : Trace
        Inputs are q (0 .. n-1), v (n .. 2n-1) and a (2n .. 3n-1) in the order of the robot's joints.
    torque : tuple of Expr or float
        Of each joint: ``mass @ a + bias + friction``.
    mass : tuple of tuple of Expr or float
        Links and rotors; a row per joint.
    bias : tuple of Expr or float
        Coriolis, centrifugal and gravity torque of the links.
    friction : tuple of Expr or float
        All other terms: friction, offset, effects.
    """

    robot: Robot
    trace: Trace
    torque: tuple[Scalar, ...]
    mass: tuple[tuple[Scalar, ...], ...]
    bias: tuple[Scalar, ...]
    friction: tuple[Scalar, ...]


def trace_model(model: TorqueModel, value: Array) -> TracedModel:
    """Trace a model with parameters ``value`` (p,); terms whose parameters are all zero are left out.

    Raises
    ------
    ValueError
        If a term with other parameters does not follow from the state.
    """
    robot, n = model.robot, model.robot.n
    trace = Trace()
    q, v, a = (traced([trace.variable(k + part * n) for k in range(n)]) for part in range(3))
    zero = traced(np.zeros(n).tolist())
    rigid, own = model.rigid_body, value[model.place(model.rigid_body)]
    unit, gravity = np.eye(n), floats(robot.model.gravity.linear)
    columns = [_rigid(rigid, own, q, zero, traced(unit[k].tolist()), ZERO) for k in range(n)]
    motion = Motion("", "", np.zeros(1), q[:, None], v[:, None], a[:, None], None, np.inf)
    rest: Array = traced(np.zeros(n).tolist())
    signals: dict[int, Signals] = {}
    for term in model.terms:
        part = value[model.place(term)]
        if isinstance(term, RigidBody) or not np.any(part):
            continue
        if isinstance(term, EffectTerm):
            if not term.effect.of_state:
                raise ValueError(f"{term.name}: {NOT_OF_STATE}")
            known = signals.setdefault(id(term.scene), _signals(term.in_state.scene, motion))
            rows = _rows(term)
            term.effect.fill(known, term.member, rows)
            rest = rest + _summed(term, rows, part)
        else:
            rest = rest + _torque(term, part, motion)
    return TracedModel(
        robot,
        trace,
        tuple(_rigid(rigid, own, q, v, a, gravity) + rest),
        _symmetric(robot, columns),
        tuple(_rigid(rigid, own, q, v, zero, gravity)),
        tuple(rest),
    )


def _symmetric(robot: Robot, columns: Sequence[Array]) -> tuple[tuple[Scalar, ...], ...]:
    """Return the rows of the mass matrix, each pair of joints from the acceleration of the one nearer to the tool."""

    def entry(j: int, k: int) -> Scalar:
        nearer = robot.order[j] <= robot.order[k]
        found: Scalar = columns[k][j] if nearer else columns[j][k] * float(robot.row_scale[j] / robot.row_scale[k])
        return found

    return tuple(tuple(entry(j, k) for k in range(robot.n)) for j in range(robot.n))


def _rigid(term: RigidBody, value: Array, q: Array, v: Array, a: Array, gravity: Vector) -> Array:
    """Return the torque of links and rotors, recorded side, shape (n,)."""
    robot: Robot = term.robot
    n, standard = robot.n, term.standard(value)
    bodies, armature = standard[: 10 * n].reshape(n, 10), standard[10 * n :]
    back = np.argsort(robot.order)
    torque = trace_torque(
        joint_geometry(robot.model), gravity, bodies[back], list(q[back]), list(v[back]), list(a[back])
    )
    return robot.row_scale * (traced(torque)[robot.order] + armature * a)


def _signals(scene: Scene, motion: Motion) -> Signals:
    """Return signals whose predicted torques are recorded, as effects need them."""
    rigid = scene.model.rigid_body
    own = scene.value[scene.model.place(rigid)]
    q, v, a = (part[:, 0] for part in (motion.q, motion.v, motion.a))
    torque = _rigid(rigid, own, q, v, a, floats(scene.robot.model.gravity.linear))
    others = (
        _torque(term, scene.value[scene.model.place(term)], motion) for term in scene.model.terms if term is not rigid
    )
    return Signals(scene, motion).with_made(rigid=torque[:, None], predicted=sum(others, torque)[:, None])


def _rows(term: Term) -> list[Array]:
    return [traced(np.zeros((int(np.count_nonzero(row)), 1))) for row in term.pattern]


def _torque(term: Term, value: Array, motion: Motion) -> Array:
    rows = _rows(term)
    term.fill(motion, rows)
    return _summed(term, rows, value)


def _summed(term: Term, rows: Sequence[Array], value: Array) -> Array:
    """Return the torque of a term's columns, shape (n,)."""
    total = [
        sum((float(x) * entry for x, entry in zip(value[own], row[:, 0], strict=True)), 0.0)
        for own, row in zip(term.pattern, rows, strict=True)
    ]
    return traced(total)


# For the type checker an array of numbers, in whose place it stands.
class TracedArray(np.ndarray[Any, np.dtype[np.float64]]):
    """An array of expressions and numbers that also knows the functions which numpy has for numbers only."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, out: Any = None, **more: Any) -> Any:
        """Evaluate a function element by element."""
        plain = [np.asarray(item) if isinstance(item, np.ndarray) else item for item in inputs]
        targets = None if out is None else tuple(np.asarray(item) for item in out)
        own = _FUNCTIONS.get(ufunc) if method == "__call__" else None
        if own is None:
            result = getattr(ufunc, method)(*plain, **(more if targets is None else {**more, "out": targets}))
        else:
            result = np.frompyfunc(own, ufunc.nin, 1)(*plain)
            if targets is not None:
                np.copyto(targets[0], result)
        if out is not None:
            return out[0]
        return traced(result) if isinstance(result, np.ndarray) and result.dtype.hasobject else result


def traced(values: Iterable[Any]) -> TracedArray:
    """Return expressions and numbers, or an array of them, as an array that records."""
    found: TracedArray = np.asarray(values, dtype=object).view(TracedArray)
    return found


def _sign(value: Scalar) -> Scalar:
    return value.direction() if isinstance(value, Expr) else float(np.sign(value))


def _below(value: Scalar, bound: float) -> bool:
    """Whether a value lies below a bound; an expression is only known to lie below what is infinite."""
    if isinstance(value, Expr) and bound != np.inf:
        raise TypeError("whether an expression is below a finite number is not known while it is recorded")
    return not bool(isinstance(value, float) and value >= bound)


def _of(function: np.ufunc, name: str) -> Callable[[Scalar], Scalar]:
    def evaluate(value: Scalar) -> Scalar:
        return getattr(value, name)() if isinstance(value, Expr) else float(function(value))

    return evaluate


_FUNCTIONS: dict[np.ufunc, Callable[..., Any]] = {
    np.sign: _sign,
    np.absolute: lambda value: abs(value),
    np.sin: _of(np.sin, "sin"),
    np.cos: _of(np.cos, "cos"),
    np.exp: _of(np.exp, "exp"),
    np.tanh: _of(np.tanh, "tanh"),
    np.less: _below,
    np.square: lambda value: value * value,
    np.power: lambda value, power: value**power,
}
