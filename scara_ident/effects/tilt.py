"""A base that is not level: gravity where the model has none."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.following import EstimateSlopes, LinkSlopes
from scara_ident.effects.gravity import first_moments, gravity_columns, gravity_size, gravity_torque, sideways
from scara_ident.effects.links import shared
from scara_ident.effects.parameters import Member, NonlinearParameter, Parameter, View
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.spanned import rows_by_sample
from scara_ident.effects.tool_force import ToolForce
from scara_ident.model.terms import Column, RigidBody
from scara_ident.robot.robot import Robot

# A base that leans further, rad, is seen by eye.
LARGEST_TILT = 0.1
# Nominal first moments of links that the base model says nothing of are believed within this factor.
MOMENT_FACTOR = 2.0
# Torques below this share of the largest are rounding of angles in the URDF.
NEGLIGIBLE_TORQUE_SHARE = 1e-4
# Known and newly entering parameters agree on the direction of gravity within this many standard deviations.
AGREEMENT_STDS = 3.0
# Samples whose columns are made at once.
AT_ONCE = 2048


@dataclass(frozen=True, eq=False)
class _Gravity:
    """How gravity along minus the two directions across it enters the torque, per robot.

    Attributes
    ----------
    known : ndarray, shape (4 n, b)
        First moments per base parameter.
    known_axes : tuple of int
        Directions of gravity that the base parameters tell.
    entering : ndarray, shape (4 n, r)
        First moments, one combination per column, that the base parameters leave out and this gravity brings in.
    entering_axes : tuple of int
        Direction of gravity of each column of ``entering``.
    nominal : ndarray, shape (4 n,)
        The nominal ones of them.
    blend : ndarray, shape (r, 2)
        Coefficients of the columns of ``entering`` per tilt, with the nominal parameters.
    """

    known: Array
    known_axes: tuple[int, ...]
    entering: Array
    entering_axes: tuple[int, ...]
    nominal: Array
    blend: Array


@lru_cache(maxsize=16)
def _gravity(term: RigidBody) -> _Gravity:
    from scipy.linalg import qr

    robot, base = term.robot, term.base
    kept, moments = first_moments(robot), base.kept
    count = base.grouping.shape[1]
    leads = np.zeros((count, base.count))
    leads[moments, np.arange(base.count)] = 1.0
    rest = (np.eye(count) - leads @ base.grouping)[kept]
    nominal = rest @ robot.standard_parameters()
    known = leads[np.ix_(kept, term.kept)]

    rng = np.random.default_rng(0)
    reach = np.where(robot.prismatic, 1.0, np.pi)[:, None]
    q = reach * rng.uniform(-1.0, 1.0, (robot.n, max(30, 10 * robot.n)))
    columns = [rows_by_sample(gravity_columns(robot, axis, q)) for axis in range(2)]
    largest = max(float(np.max(np.linalg.norm(part, axis=0))) for part in columns) or 1.0
    axes = tuple(axis for axis in range(2) if np.linalg.norm(columns[axis] @ known) > NEGLIGIBLE_TORQUE_SHARE * largest)
    new = np.hstack([part @ rest for part in columns])
    pivots: list[int] = []
    if np.max(np.abs(new), initial=0.0) > 0.0:
        _, factor, order = qr(new, mode="economic", pivoting=True)
        size = np.abs(np.diag(factor))
        pivots = sorted(int(k) for k in order[: np.count_nonzero(size > NEGLIGIBLE_TORQUE_SHARE * largest)])
    chosen = np.array(pivots, dtype=np.intp)
    blend: Array = np.zeros((len(pivots), 2), dtype=np.float64)
    if pivots:
        wanted = np.column_stack([part @ nominal for part in columns])
        blend = np.asarray(np.linalg.lstsq(new[:, chosen], wanted, rcond=None)[0], dtype=np.float64)
        blend[np.abs(blend) < 1e-9 * np.max(np.abs(blend), initial=1e-300)] = 0.0
    return _Gravity(
        known=known,
        known_axes=axes,
        entering=rest[:, chosen % count],
        entering_axes=tuple(int(k) // count for k in chosen),
        nominal=nominal,
        blend=blend,
    )


def _known_torque(signals: Signals, axis: int) -> Array:
    """Return the torque of what the estimate knows under gravity against a direction across it, shape (n, N)."""
    scene = signals.scene
    return shared(
        signals,
        ("tilt", axis),
        lambda: gravity_torque(scene.robot, signals.motion.q, _against(scene.robot, axis), _known_moments(scene)),
    )


def _nominal_torque(signals: Signals, axis: int) -> Array:
    """Return the same of what the base parameters leave out, with the URDF's masses and first moments."""
    gravity = _gravity(signals.scene.model.rigid_body)
    return _of_motion(signals, ("nominal", gravity, axis), axis, gravity.nominal)


def _entering_torques(signals: Signals) -> list[Array]:
    """Return the torque of each combination of first moments that enters."""
    gravity = _gravity(signals.scene.model.rigid_body)
    return [
        _of_motion(signals, ("entering", gravity, k), axis, gravity.entering[:, k])
        for k, axis in enumerate(gravity.entering_axes)
    ]


def _of_motion(signals: Signals, key: Hashable, axis: int, moments: Array) -> Array:
    robot, q = signals.scene.robot, signals.motion.q
    return shared(signals.motion, key, lambda: gravity_torque(robot, q, _against(robot, axis), moments))


def _known_moments(scene: Scene) -> Array:
    """Return masses and first moments as the present estimate has them, each in the place that leads its base parameter, shape (4 n,)."""
    term = scene.model.rigid_body
    return np.asarray(_gravity(term).known @ scene.value[scene.model.place(term)])


def _against(robot: Robot, axis: int) -> Array:
    """Return gravity along minus one of the directions across it, base frame, m/s^2, shape (3,)."""
    return np.asarray(-gravity_size(robot) * sideways(robot)[axis][1])


def _known_slopes(signals: Signals, axes: Sequence[int], tilt: Array) -> EstimateSlopes:
    """Return the derivatives of the known parameters' torque under gravity against directions across it, by these parameters."""
    scene, motion = signals.scene, signals.motion
    term = scene.model.rigid_body
    # A base parameter stands for the one moment that leads it.
    moments, places = np.nonzero(_gravity(term).known)
    result = np.zeros((scene.robot.n, len(places), motion.samples))
    for axis, size in zip(axes, tilt.tolist(), strict=True):
        for start in range(0, motion.samples, AT_ONCE):
            part = slice(start, start + AT_ONCE)
            result[:, :, part] += size * gravity_columns(scene.robot, axis, motion.q[:, part])[:, moments]
    return {joint: (scene.model.place(term).start + places, rows) for joint, rows in enumerate(result)}


class _Tilt(Effect):
    """What both ways to tell a tilt share."""

    name = "base_tilt"
    summary = "a base that is not level"
    follows_estimate = True
    on_links = True
    of_position = True
    of_state = True
    imitated_by = (ToolForce(),)
    watched = True
    view = View("position")
    experiment = "hold still, or move very slowly, at positions over more than half a turn: a tilt's torque follows the sine of the angle, a spring's the angle"

    @abstractmethod
    def pulls(self, scene: Scene, member: Member, value: Array) -> tuple[tuple[Array, Array], ...]:
        """Return gravities, shape (3,), with the masses and first moments, shape (4 n,), whose torques together are those of coefficients (k,)."""

    def torque_on_links(self, signals: Signals, member: Member, value: Array) -> Array:
        """Return what `signal_columns` add up to, at once."""
        return self._summed(signals, member, value)

    def link_slopes(self, signals: Signals, member: Member, value: Array, joint: int) -> LinkSlopes:
        """Return exact derivatives."""
        return (self._summed(signals, member, value, joint),)

    def _summed(self, signals: Signals, member: Member, value: Array, joint: int | None = None) -> Array:
        scene, q, found = signals.scene, signals.motion.q, np.zeros_like(signals.motion.q)
        for gravity, moments in self.pulls(scene, member, value):
            found += gravity_torque(scene.robot, q, gravity, moments, joint)
        return found


class BaseTilt(_Tilt):
    """Gravity's components -g tilt_x and -g tilt_y along the base's x and y axes.

    With a hanging or leaning base the two axes are those across gravity.

    The tilt is determined by its influence on parameters that the model estimates anyway. On an arm with vertical axes
    the components also bring in first moments that no motion determined before (of the first link, and of all that it
    carries); these have their own columns, whose coefficients are tilt times first moment. If their direction agrees
    with the URDF's first moments, they take part in the estimate of the tilt. If only one joint has a torque over
    position, such as that of a spring, these coefficients absorb it and the tilt is zero.
    """

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One, where the model's parameters feel gravity from the side."""
        return (Member(None),) if _gravity(scene.model.rigid_body).known_axes else ()

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Tilt about each axis that can be identified, then what enters newly."""
        gravity = _gravity(scene.model.rigid_body)
        tilts = (_tilt_column(scene.robot, axis) for axis in gravity.known_axes)
        units = (_moment_unit(scene.robot, gravity.entering[:, k]) for k in range(len(gravity.entering_axes)))
        entering = (
            Column(f"tilt_moment{k + 1}", None, unit, "tilt times a first moment that has no effect with a level base")
            for k, unit in enumerate(units)
        )
        return (*tilts, *entering)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torques of known parameters under sideways gravity and those of new ones."""
        axes = _gravity(signals.scene.model.rigid_body).known_axes
        return [*(_known_torque(signals, axis) for axis in axes), *_entering_torques(signals)]

    def pulls(self, scene: Scene, member: Member, value: Array) -> tuple[tuple[Array, Array], ...]:
        """Return both directions, each with what is known times its tilt and what enters."""
        gravity, known = _gravity(scene.model.rigid_body), _known_moments(scene)
        moments = np.zeros((2, len(known)))
        for tilt, axis in zip(value, gravity.known_axes, strict=False):
            moments[axis] += tilt * known
        for k, axis in enumerate(gravity.entering_axes, len(gravity.known_axes)):
            moments[axis] += value[k] * gravity.entering[:, k - len(gravity.known_axes)]
        return tuple((_against(scene.robot, axis), each) for axis, each in enumerate(moments) if np.any(each))

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those by the known first moments, which turn with gravity."""
        axes = _gravity(signals.scene.model.rigid_body).known_axes
        return _known_slopes(signals, axes, value[: len(axes)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """The base is nearly level, and parameters that are known show what new ones show."""
        gravity = _gravity(scene.model.rigid_body)
        count = len(gravity.known_axes)
        steep = _too_steep(value[:count], std[:count])
        if steep is not None or not gravity.entering_axes:
            return steep
        if np.all(np.abs(value[:count]) < DOUBT_STDS * std[:count]):
            return "only one joint shows it, as with a spring; gravity would act on other joints too"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the tilt, from all columns where they agree, else from those of known parameters."""
        gravity = _gravity(scene.model.rigid_body)
        count = len(gravity.known_axes)
        tilt, spread = value[:count], covariance[:count, :count]
        if count == 2 and np.any(gravity.blend):
            tilt, spread = _combined(value, covariance, gravity.blend)
        return {
            _tilt_column(scene.robot, axis).name: Parameter(float(tilt[k]), float(np.sqrt(spread[k, k])), "rad")
            for k, axis in enumerate(gravity.known_axes)
        }


class NominalBaseTilt(_Tilt):
    """The same, with the URDF's first moments, up to one factor, for those that a level base does not determine.

    It needs two columns where `BaseTilt` needs more, so it finds a smaller tilt, and it finds it on all joints at once;
    a spring acts on one joint only. It is not tried if no new parameter enters.
    """

    nonlinear = (NonlinearParameter("moment_factor", "1", 1.0 / MOMENT_FACTOR, MOMENT_FACTOR),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return five factors; one where nothing else is known of gravity and factor and tilt are one."""
        gravity = _gravity(scene.model.rigid_body)
        if not np.any(gravity.blend):
            return ()
        if not gravity.known_axes:
            return (Member(None, (1.0,)),)
        return tuple(Member(None, (float(x),)) for x in np.geomspace(1.0 / MOMENT_FACTOR, MOMENT_FACTOR, 5))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Tilt about each axis."""
        return tuple(_tilt_column(scene.robot, axis) for axis in self._axes(scene))

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque under sideways gravity."""
        factor, axes = self._factor(signals.scene, member), self._axes(signals.scene)
        return [_known_torque(signals, axis) + factor * _nominal_torque(signals, axis) for axis in axes]

    def pulls(self, scene: Scene, member: Member, value: Array) -> tuple[tuple[Array, Array], ...]:
        """Return both directions at once: they pull at the same bodies."""
        axes = zip(value, self._axes(scene), strict=True)
        sideward = sum((tilt * _against(scene.robot, axis) for tilt, axis in axes), np.zeros(3))
        nominal = _gravity(scene.model.rigid_body).nominal
        return ((sideward, _known_moments(scene) + self._factor(scene, member) * nominal),)

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those by the known first moments, which turn with gravity."""
        return _known_slopes(signals, self._axes(signals.scene), value)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """The base is nearly level."""
        return _too_steep(value, std)

    def _factor(self, scene: Scene, member: Member) -> float:
        return member.nonlinear[0] if _gravity(scene.model.rigid_body).known_axes else 1.0

    def _axes(self, scene: Scene) -> list[int]:
        gravity = _gravity(scene.model.rigid_body)
        return [axis for axis in range(2) if axis in gravity.known_axes or np.any(gravity.blend[:, axis])]


def _tilt_column(robot: Robot, axis: int) -> Column:
    name, direction = sideways(robot)[axis]
    exact = np.max(np.abs(direction)) == 1.0
    along = f"the base's {name}" if exact else f"({', '.join(f'{x:.3g}' for x in direction)}) of the base"
    return Column(f"tilt_{name}", None, "rad", f"gravity along {along} is -g times this")


def _moment_unit(robot: Robot, moments: Array) -> str:
    # A mass enters beside first moments only where a prismatic joint slides along the base's x or y.
    return (
        "kg"
        if np.any(robot.prismatic) and np.any(moments[::4]) and not np.any(moments.reshape(-1, 4)[:, 1:])
        else "kg m"
    )


def _too_steep(tilt: Array, std: Array) -> str | None:
    if np.any(np.abs(tilt) > LARGEST_TILT + DOUBT_STDS * std):
        return f"a base tilted by {float(np.max(np.abs(tilt))):.2g} rad would be visible"
    return None


def _combined(value: Array, covariance: Array, blend: Array) -> tuple[Array, Array]:
    """Fit tilt and one factor on the nominal first moments to all coefficients, by Gauss and Newton."""
    from scipy.special import chdtrc, chdtri

    size = np.sqrt(np.clip(np.diag(covariance), np.finfo(float).tiny, None))
    weight = np.linalg.pinv(covariance / np.outer(size, size), rcond=1e-9, hermitian=True) / np.outer(size, size)
    tilt = value[:2].copy()
    ideal = blend @ tilt
    factor = float(ideal @ value[2:] / max(float(ideal @ ideal), np.finfo(float).tiny))
    factor = float(np.clip(factor, 1.0 / MOMENT_FACTOR, MOMENT_FACTOR))
    for _ in range(20):
        error = value - np.concatenate([tilt, factor * blend @ tilt])
        slope = np.column_stack(
            [np.vstack([np.eye(2), factor * blend]), np.concatenate([np.zeros(2), blend @ tilt])]
        )  # fmt: skip
        normal = slope.T @ weight @ slope
        step = np.linalg.pinv(normal, rcond=1e-12, hermitian=True) @ slope.T @ weight @ error
        tilt, factor = tilt + step[:2], factor + float(step[2])
    error = value - np.concatenate([tilt, factor * blend @ tilt])
    disagreement = float(error @ weight @ error)
    free = len(value) - 3
    accepted = float(chdtri(free, chdtrc(1, AGREEMENT_STDS**2))) if free > 0 else np.inf
    believed = 1.0 / MOMENT_FACTOR <= factor <= MOMENT_FACTOR
    if not np.isfinite(disagreement) or disagreement > accepted or not believed:
        return value[:2], covariance[:2, :2]
    spread = np.linalg.pinv(slope.T @ weight @ slope, rcond=1e-12, hermitian=True)
    return tilt, spread[:2, :2]
