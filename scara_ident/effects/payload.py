"""Payloads on the last link, and counterweights on the links."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.gravity import loaded_by_gravity
from scara_ident.effects.links import point_mass, shared, tool_of
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, Parameter, View, deviation
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.effects.recording_groups import MIN_SPEED_SHARE, groups_by_torque
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.sinusoid import Sinusoid
from scara_ident.effects.spanned import rows_by_sample
from scara_ident.model.base_parameters import BODY_PARAMETERS, BODY_UNITS, size_of
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

# Instants tried over a run with the mounting known; a tenth of a run apart, which refinement bridges.
INSTANTS = 9
# Instants tried with the mounting unknown: fewer, for every one has more columns.
INSTANTS_FREE = 4
# Columns for a payload mounted anyhow: more of its ten parameters let an effect imitate anything.
FREE_COLUMNS = 4
# A further one must add this share of the torque of the first, or it is noise that is fitted.
FREE_COLUMN_SHARE = 0.02
# Of a payload through whole recordings all is identified that is more than rounding.
BODY_COLUMNS, BODY_COLUMN_SHARE = 10, 1e-3
# Masses and moments of inertia are seen to be there this many standard deviations from none: 0.3 % two-sided.
SEEN_STDS = 3.0
# Joints on which a payload's torque is below this share of its largest hardly tell when it came.
LOADED = 0.2
# A tool nearer to the last joint than this share of the arm's size says nothing of how far out an unknown payload sits.
SHORTEST_ARM = 0.1


class PayloadChange(Effect):
    """A mass at the tool point that is there from some time in the run on; negative where it was put down."""

    name = "payload_change"
    summary = "a payload picked up or put down during a run"
    coefficients = (Coefficient("mass", "kg", "mass at the tool from some time in the run on"),)
    nonlinear: ClassVar[tuple[NonlinearParameter, ...]] = (
        NonlinearParameter("time", "s", 0.0, np.inf, False, jumps=True),
    )
    on_links = True
    view = View("time")
    experiment = "repeat the run with the payload fastened, and once without it"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return instants spread over the longest run."""
        return _instants(scene, INSTANTS)

    def gap(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return how long no joint that a payload loads moves about the instant: where it rests it tells nothing."""
        rests = [_rest_about(scene, motion, member.nonlinear[0]) for motion in scene.columns]
        return (min(rests, default=0.0),)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque of 1 kg at the tool from then on."""
        return [_at_tool(signals) * self.acting(signals, member)]

    def acting(self, signals: Signals, member: Member) -> Array:
        """Return 0 before and 1 after an instant, over one sample, shape (N,)."""
        return np.clip((signals.time - member.nonlinear[0]) * signals.motion.rate + 0.5, 0.0, 1.0)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where an arm would carry or drop more than it weighs."""
        return _too_heavy(scene, float(value[0]), float(std[0]))


@dataclass(frozen=True)
class FreePayloadChange(PayloadChange):
    """A body that the last link carries from some time in the run on, mounted in any way.

    Its mass, first moments and inertia are columns as far as the torque determines them. A mass is reported only if the
    torque determines it separately from the other parameters.

    Attributes
    ----------
    whole : bool
        Whether all parameters that the torque determines are columns, or only the few most important ones. With so many
        columns it can imitate other effects, so the whole body is tried only after the few columns passed the tests.
    """

    whole: bool = False

    summary = "a payload at an unknown place, picked up or put down during a run"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return instants spread over the longest run."""
        return _instants(scene, INSTANTS_FREE)

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe those of the body's standard parameters that tell most."""
        meaning = "{} of a payload in the frame of the last joint"
        return tuple(
            Column(f"payload_{name}", None, BODY_UNITS[k], meaning.format(name))
            for k in self._determined(scene.robot)
            for name in [BODY_PARAMETERS[k]]
        )

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque per standard parameter of the payload from then on."""
        columns = body_columns(signals, self._determined(signals.scene.robot))
        return np.moveaxis(columns * self.acting(signals, member), 1, 0)

    def in_full(self) -> Effect | None:
        """Return the family with all columns."""
        return None if self.whole else replace(self, whole=True)

    def essential(self, scene: Scene, member: Member) -> slice:
        """Return the mass where the torque tells it, if all of the body is tried: see `PayloadOfRecordings.essential`."""
        return slice(0, 1) if self.whole and self._determined(scene.robot)[0] == 0 else slice(None)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where mass and inertia differ in sign, or an arm would carry more than it weighs."""
        shown = self._determined(scene.robot)
        # Masses and moments of inertia of one body are all positive, or all negative if it was taken away.
        signs = {
            float(np.sign(value[place]))
            for place, k in enumerate(shown)
            if k in (0, 4, 6, 9) and abs(value[place]) > SEEN_STDS * std[place]
        }
        if len(signs) > 1:
            return "mass and inertia would have opposite signs"
        return super().inadmissible(scene, member, value, std) if shown[0] == 0 else None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return what the columns say, the mass under its own name."""
        found = super().parameters(scene, member, value, covariance).values()
        names = ("mass" if k == 0 else BODY_PARAMETERS[k] for k in self._determined(scene.robot))
        return dict(zip(names, found, strict=True))

    def _determined(self, robot: Robot) -> tuple[int, ...]:
        """Return the standard parameters that are estimated."""
        return shown_of(robot, BODY_COLUMNS, BODY_COLUMN_SHARE) if self.whole else shown_of(robot)


@dataclass(frozen=True)
class PayloadOfRecordings(Effect):
    """A body that the last link carries in some recordings and not in others, mounted in any way.

    The recordings are grouped by their torque, see `groups_by_torque`; their group is a member's partner, a bit for
    each recording in the order of the scene. If all recordings have the same payload, the base model absorbs it and
    only a known mass can determine it.

    Attributes
    ----------
    unloaded : frozenset of str
        Recordings known to be without payload.
    at_tool : bool
        Whether it is known to be a compact weight at the tool; on an arm with vertical axes its mass is then determined
        much better.
    """

    unloaded: frozenset[str] = frozenset()
    at_tool: bool = False

    name = PayloadChange.name
    summary = "a payload in {recordings} and not in the others"
    on_links = True
    view = PayloadChange.view
    experiment = PayloadChange.experiment
    by_recording = True

    def knowing(self, unloaded: frozenset[str]) -> PayloadOfRecordings:
        """Return the family that knows which recordings are without payload."""
        return replace(self, unloaded=unloaded)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return one per group of recordings."""
        determined = [k for k in shown_of(scene.robot, BODY_COLUMNS, BODY_COLUMN_SHARE) if k < 4]
        found = groups_by_torque(scene, determined, self.unloaded) if determined else ()
        return tuple(self.in_recordings(scene, Member(None), group) for group in found)

    def in_recordings(self, scene: Scene, member: Member, names: frozenset[str]) -> Member:
        """Return the member that also acts in further recordings of the scene."""
        bits = sum(1 << k for k, name in enumerate(scene.start) if name in names)
        return replace(member, partner=bits if member.partner is None else member.partner | bits)

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Add the recordings of the group."""
        group = [name for k, name in enumerate(scene.start) if member.partner_place >> k & 1]
        return {"recordings": ", ".join(group)}

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe those of the body's standard parameters that the torque tells."""
        meaning = "{} of a payload in the frame of the last joint"
        return tuple(
            Column(f"payload_{BODY_PARAMETERS[k]}", None, BODY_UNITS[k], meaning.format(BODY_PARAMETERS[k]))
            for k in self._determined(scene.robot)
        )

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque per standard parameter of the payload in recordings of the group, else zero."""
        names = list(signals.scene.start)
        name = signals.motion.name
        if name not in names or not member.partner_place >> names.index(name) & 1:
            return np.zeros((len(self._determined(signals.scene.robot)), *signals.motion.q.shape))
        return self.carried(signals, member)

    def carried(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the torque per standard parameter of the payload, (n, N) each."""
        return (
            [_at_tool(signals)]
            if self.at_tool
            else np.moveaxis(body_columns(signals, self._determined(signals.scene.robot)), 1, 0)
        )

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where the mass is negative, or more than the arm weighs."""
        if self._determined(scene.robot)[0] != 0:
            return None
        if value[0] < -SEEN_STDS * std[0]:
            if _short_of_body(self._determined(scene.robot), -value, std):
                return "its mass would be negative, and no removed body has such moments: these recordings differ in something else too"
            return "its mass would be negative: these recordings carry less than the others, or the difference is not a body"
        return _too_heavy(scene, float(value[0]), float(std[0]))

    def essential(self, scene: Scene, member: Member) -> slice:
        """Return the mass where the torque tells it: a body has one, and runs that differ seem to turn without any."""
        return slice(0, 1) if self._determined(scene.robot)[0] == 0 else slice(None)

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return mass and centre of mass where they can be determined, and the body's standard parameters."""
        shown = self._determined(scene.robot)
        plain = super().parameters(scene, member, value, covariance).values()
        found = {"mass" if k == 0 else BODY_PARAMETERS[k]: item for k, item in zip(shown, plain, strict=True)}
        if shown[0] == 0 and value[0] > SEEN_STDS * deviation(covariance):
            for axis, k in zip("xyz", (1, 2, 3), strict=True):
                if k in shown:
                    place = shown.index(k)
                    slope = np.zeros(len(value))
                    slope[[0, place]] = -value[place] / value[0] ** 2, 1.0 / value[0]
                    spread = slope[None] @ covariance @ slope[:, None]
                    found[f"com_{axis}"] = Parameter(float(value[place] / value[0]), deviation(spread), "m")
        return found

    def _determined(self, robot: Robot) -> tuple[int, ...]:
        """Return the standard parameters that are estimated."""
        return (0,) if self.at_tool else shown_of(robot, BODY_COLUMNS, BODY_COLUMN_SHARE)


class GravityCounterbalance(Sinusoid):
    """A spring or weight that balances a joint: ``u = a sin q + b cos q``.

    If gravity already depends on the same angle, as on the first joint of a planar arm or on a shoulder directly after
    a vertical axis, the model absorbs it. It may act in both directions.
    """

    name = "gravity_counterbalance"
    summary = "a spring or weight that balances the joint, or a ripple once per its turn"
    coefficients = (
        Coefficient("balance_sin", "{torque}", "torque of a counterbalance of {joint} per sine of its position"),
        Coefficient("balance_cos", "{torque}", "torque of a counterbalance of {joint} per cosine of its position"),
    )
    amplitude_name = "torque"
    on_links = True
    of_state = True
    not_simulated = "the springs of the virtual arm are linear in the angle"

    def joints(self, scene: Scene) -> list[int]:
        """Return the revolute joints that gravity loads."""
        return [j for j, loaded in enumerate(loaded_by_gravity(scene.robot)) if loaded]

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return sine and cosine of the position."""
        q = signals.motion.q[member.place]
        return [np.sin(q), np.cos(q)]

    def same_columns(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return the ripple once per turn of a motor without a gear, or whose gear the description does not state."""
        direct = abs(float(scene.robot.reduction[member.place])) == 1.0
        return ((TorqueRipple(), Member(member.joint, (1.0,))),) if direct else ()


def _instants(scene: Scene, count: int) -> tuple[Member, ...]:
    """Return instants of all recordings alike."""
    return tuple(Member(None, ((k + 0.5) * scene.duration / count,)) for k in range(count))


def _rest_about(scene: Scene, motion: Motion, instant: float) -> float:
    """Return how long joints rest about an instant of a recording that a mass at the tool loads, s; infinite off the motion."""
    time = motion.time - scene.start.get(motion.name, float(motion.time[0]))
    load = np.sqrt(np.mean(_at_tool(Signals(scene, motion)) ** 2, axis=1)) / np.abs(scene.robot.row_scale)
    moving = np.abs(motion.v) >= MIN_SPEED_SHARE * scene.speed[:, None]
    telling = time[np.any(moving[load >= LOADED * np.max(load)], axis=0)]
    place = int(np.searchsorted(telling, instant))
    return float(telling[place] - telling[place - 1]) if 0 < place < len(telling) else np.inf


def _at_tool(signals: Signals) -> Array:
    """Return the torque of 1 kg at the tool, shape (n, N)."""
    robot = signals.scene.robot

    def make() -> Array:
        tool = tool_of(robot)
        return np.asarray(np.einsum("jkn,k->jn", tool.columns(robot, signals.motion), point_mass(tool.point)))

    return shared(signals.motion, "payload", make)


def body_columns(signals: Signals, shown: Sequence[int]) -> Array:
    """Return the torque per standard parameter of a body on the last link, of those shown, shape (n, k, N)."""
    robot = signals.scene.robot
    # Of a planar arm most of the ten are nothing, and are not held.
    held = sorted({*shown_of(robot), *shown_of(robot, BODY_COLUMNS, BODY_COLUMN_SHARE)})
    columns = shared(signals.motion, "payload body", lambda: tool_of(robot).columns(robot, signals.motion)[:, held])
    return columns[:, [held.index(k) for k in shown]]


def _short_of_body(shown: Sequence[int], value: Array, std: Array) -> bool:
    """Whether moments of inertia are clearly less than a mass with such first moments has by lying off the axis (Steiner)."""
    place = {k: at for at, k in enumerate(shown)}
    for inertia, across in ((4, (2, 3)), (6, (1, 3)), (9, (1, 2))):
        if not {0, inertia} <= place.keys():
            continue
        (mass, own), (of_mass, of_own) = ([each[place[0]], each[place[inertia]]] for each in (value, std))
        moments = np.array([[value[place[k]], std[place[k]]] for k in across if k in place]).reshape(-1, 2)
        missing = float(np.sum(moments[:, 0] ** 2)) - mass * own
        spread = np.hypot(np.linalg.norm(2.0 * np.prod(moments, axis=1)), np.hypot(own * of_mass, mass * of_own))
        if missing > SEEN_STDS * spread:
            return True
    return False


def _too_heavy(scene: Scene, mass: float, std: float) -> str | None:
    weight = float(np.sum(scene.robot.standard_parameters()[: 10 * scene.robot.n : 10]))
    if weight > 0.0 and abs(mass) > weight + DOUBT_STDS * std:
        return f"a payload of {mass:.3g} kg is more than the arm's own {weight:.3g} kg"
    return None


@lru_cache(maxsize=8)
def shown_of(robot: Robot, most: int = FREE_COLUMNS, share: float = FREE_COLUMN_SHARE) -> tuple[int, ...]:
    """Return the standard parameters of a payload that tell most, each beside those before it, mass first if it can."""
    tool = tool_of(robot)
    rng = np.random.default_rng(0)
    # By the arm's size, so that what a metre is makes no difference.
    size = size_of(robot)
    unit = np.where(robot.prismatic, size, 1.0)
    scales = (np.where(robot.prismatic, 0.3, np.pi) * unit, np.where(robot.prismatic, 0.3, 1.0) * unit, 3.0 * unit)
    q, v, a = (scale[:, None] * rng.uniform(-1.0, 1.0, (robot.n, 60)) for scale in scales)
    motion = Motion("random", "random", np.arange(60.0), q, v, a, None, 1.0)
    arm = max(float(np.linalg.norm(tool.point)), SHORTEST_ARM * size)
    force = np.abs(robot.row_scale) * np.where(robot.prismatic, 1.0, size)
    columns = tool.columns(robot, motion) / force[:, None, None]
    rows = rows_by_sample(columns) * arm ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    largest = float(np.max(np.linalg.norm(rows, axis=0))) or 1.0
    chosen: list[int] = []
    left = rows.copy()
    while len(chosen) < most:
        size = np.linalg.norm(left, axis=0)
        k = 0 if not chosen and size[0] > share * largest else int(np.argmax(size))
        if size[k] <= share * largest:
            break
        chosen.append(k)
        direction = left[:, k] / size[k]
        left = left - np.outer(direction, direction @ left)
    return tuple(sorted(chosen)) or (0,)
