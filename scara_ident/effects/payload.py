"""What the last link carries, and what balances the links."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.links import point_mass, shared, tool_of
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.base_parameters import BODY_PARAMETERS, BODY_UNITS
from scara_ident.model.terms import Column
from scara_ident.motion.motion import Motion
from scara_ident.recording.recording import split_name
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]

# Instants tried over a run, with the mounting known and unknown.
INSTANTS = 9
INSTANTS_FREE = 4
# Columns for a payload mounted anyhow; the next would add less than this share of the torque of the first.
MOST_FREE = 4
LEAST_FREE = 0.02
# Groups of recordings tried.
MOST_GROUPS = 24
# A tool nearer to the last joint than this, m, says nothing of how far out an unknown payload sits.
SHORTEST_ARM = 0.1


@dataclass(frozen=True)
class PayloadChange:
    """A mass at the tool point that is there from some time in the run on; negative where it was put down."""

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "payload_change"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The time in the run."""
        return (_TIME,)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Instants spread over the longest run."""
        return tuple(Member(None, (time,)) for time in _instants(scene, INSTANTS))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the mass."""
        return (Column("mass", None, "kg", "mass at the tool from some time in the run on"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the torque of 1 kg at the tool from then on, shape (n, 1, N)."""
        return np.asarray(_at_tool(signals) * _after(signals, member.nonlinear[0]))

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """No arm carries or drops more than it weighs."""
        return _too_heavy(scene, float(value[0]), float(std[0]))

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the mass."""
        return {"mass": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), "kg")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a payload taken up or put down in the run"


@dataclass(frozen=True)
class FreePayloadChange:
    """A body that the last link carries from some time in the run on, mounted anyhow.

    Its mass, first moments and inertia are columns as far as the torque shows them; what it shows of the mass beside
    other combinations decides whether a mass is reported.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "payload_change"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The time in the run."""
        return (_TIME,)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Instants spread over the longest run."""
        return tuple(Member(None, (time,)) for time in _instants(scene, INSTANTS_FREE))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Those of the body's standard parameters that tell most."""
        return tuple(
            Column(
                f"payload_{BODY_PARAMETERS[k]}",
                None,
                BODY_UNITS[k],
                f"{BODY_PARAMETERS[k]} of a payload in the frame of the last joint",
            )
            for k in _shown(scene.robot)
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the torque per standard parameter of the payload from then on, shape (n, k, N)."""
        robot = signals.scene.robot
        columns = shared(
            signals, "free payload", lambda: tool_of(robot).columns(robot, signals.motion)[:, list(_shown(robot))]
        )
        return np.asarray(columns * _after(signals, member.nonlinear[0]))

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """No arm carries more than it weighs, and mass and inertia have one sign."""
        shown = _shown(scene.robot)
        # Masses and moments of inertia of one body are all positive, or all negative if it was taken away.
        signs = {
            float(np.sign(value[place]))
            for place, k in enumerate(shown)
            if k in (0, 4, 6, 9) and abs(value[place]) > 3.0 * std[place]
        }
        if len(signs) > 1:
            return "mass and inertia would have opposite signs"
        return _too_heavy(scene, float(value[0]), float(std[0])) if shown[0] == 0 else None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return what the columns say, the mass under its own name."""
        std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
        return {
            "mass" if k == 0 else BODY_PARAMETERS[k]: Parameter(float(value[i]), float(std[i]), BODY_UNITS[k])
            for i, k in enumerate(_shown(scene.robot))
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a payload of unknown mounting taken up or put down in the run"


@dataclass(frozen=True)
class PayloadOfRecordings:
    """A mass at the tool point in some recordings and not in others.

    Groups tried: recordings whose names share a word, each recording alone, and all from some recording on in the
    order of time; the mass counts from the first recording, whose payload is part of the last link. Where all have
    the same payload, nothing but a known mass can tell it.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "payload_change"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per group of recordings; the group's number stands for a partner."""
        return tuple(Member(None, (), k) for k in range(len(self._groups(scene))))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the mass."""
        return (Column("mass", None, "kg", f"mass at the tool in {self._words(scene, member)}"),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the torque of 1 kg at the tool in recordings of the group, else zero, shape (n, 1, N)."""
        if signals.motion.name not in self._groups(signals.scene)[member.partner or 0]:
            return np.zeros((signals.scene.robot.n, 1, signals.motion.samples))
        return _at_tool(signals)

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """No arm carries more than it weighs."""
        return _too_heavy(scene, float(value[0]), float(std[0]))

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the mass, by which the group has more than the others."""
        return {"mass": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), "kg")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is, and where."""
        return f"a payload in {self._words(scene, member)}, not in the others"

    def _words(self, scene: Scene, member: Member) -> str:
        group = sorted(self._groups(scene)[member.partner or 0])
        return ", ".join(group) if len(group) <= 4 else f"{group[0]} and {len(group) - 1} others"

    def _groups(self, scene: Scene) -> tuple[frozenset[str], ...]:
        ordered = sorted(scene.start, key=lambda name: scene.start[name])
        return _groups_of(tuple(ordered))


@dataclass(frozen=True)
class GravityCounterbalance:
    """A spring or weight that balances a joint: ``u = a sin q + b cos q``.

    Where gravity already turns with the same angle, as on the first joint of a planar arm, the model absorbs it.
    """

    @property
    def name(self) -> str:
        """Name of the effect."""
        return "gravity_counterbalance"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per revolute joint that gravity loads."""
        loaded = _loaded_by_gravity(scene.robot)
        return tuple(Member(j) for j in range(scene.robot.n) if loaded[j])

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, of sine and cosine."""
        j = member.joint or 0
        joint, unit = scene.robot.joints[j], scene.robot.torque_unit(j)
        return (
            Column("balance_sin", joint, unit, f"torque of a counterbalance of {joint} per sine of its position"),
            Column("balance_cos", joint, unit, f"torque of a counterbalance of {joint} per cosine of its position"),
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return sine and cosine of the position, shape (n, 2, N)."""
        j = member.joint or 0
        q = signals.motion.q[j]
        return signals.row(j, [np.sin(q), np.cos(q)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A counterbalance may pull either way."""
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the largest torque, and the phase of ``torque sin(q + phase)``."""
        size = float(np.hypot(*value))
        slopes = np.array([[value[0], value[1]], [-value[1] / size, value[0] / size]]) / size if size else np.eye(2)
        spread = np.sqrt(np.clip(np.diag(slopes @ covariance @ slopes.T), 0.0, None))
        return {
            "torque": Parameter(size, float(spread[0]), scene.robot.torque_unit(member.joint or 0)),
            "phase": Parameter(float(np.arctan2(value[1], value[0])), float(spread[1]), "rad"),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a spring or weight that balances the joint"


_TIME = NonlinearParameter("time", "s", 0.0, np.inf, logarithmic=False)


def _instants(scene: Scene, count: int) -> Iterable[float]:
    return ((k + 0.5) * scene.duration / count for k in range(count))


def _after(signals: Signals, instant: float) -> Array:
    """Return 0 before and 1 after an instant, over one sample, shape (N,)."""
    return np.clip((signals.time - instant) * signals.motion.rate + 0.5, 0.0, 1.0)


def _at_tool(signals: Signals) -> Array:
    robot = signals.scene.robot

    def make() -> Array:
        tool = tool_of(robot)
        columns = tool.columns(robot, signals.motion)
        return np.asarray(np.einsum("jkn,k->jn", columns, point_mass(tool.point))[:, None])

    return shared(signals, "payload", make)


def _too_heavy(scene: Scene, mass: float, std: float) -> str | None:
    weight = float(np.sum(scene.robot.standard_parameters()[: 10 * scene.robot.n : 10]))
    if weight > 0.0 and abs(mass) > weight + 2.0 * std:
        return f"a payload of {mass:.3g} kg is more than the arm's own {weight:.3g} kg"
    return None


@lru_cache(maxsize=8)
def _shown(robot: Robot) -> tuple[int, ...]:
    """Return the standard parameters of a payload that tell most, each beside those before it, mass first if it can."""
    tool = tool_of(robot)
    rng = np.random.default_rng(0)
    scales = (np.where(robot.prismatic, 0.3, np.pi), np.where(robot.prismatic, 0.3, 1.0), np.full(robot.n, 3.0))
    q, v, a = (scale[:, None] * rng.uniform(-1.0, 1.0, (robot.n, 60)) for scale in scales)
    motion = Motion("random", "random", np.arange(60.0), q, v, a, None, 1.0)
    arm = max(float(np.linalg.norm(tool.point)), SHORTEST_ARM)
    columns = tool.columns(robot, motion) / np.abs(robot.row_scale)[:, None, None]
    rows = columns.transpose(0, 2, 1).reshape(-1, 10) * arm ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    largest = float(np.max(np.linalg.norm(rows, axis=0))) or 1.0
    chosen: list[int] = []
    left = rows.copy()
    while len(chosen) < MOST_FREE:
        size = np.linalg.norm(left, axis=0)
        k = 0 if not chosen and size[0] > LEAST_FREE * largest else int(np.argmax(size))
        if size[k] <= LEAST_FREE * largest:
            break
        chosen.append(k)
        direction = left[:, k] / size[k]
        left = left - np.outer(direction, direction @ left)
    return tuple(sorted(chosen)) or (0,)


@lru_cache(maxsize=8)
def _loaded_by_gravity(robot: Robot) -> tuple[bool, ...]:
    """Return which revolute joints gravity loads, from the motion of masses alone."""
    from scara_ident.model.base_parameters import standard_regressor

    rng = np.random.default_rng(0)
    q = np.where(robot.prismatic, 0.3, np.pi)[:, None] * rng.uniform(-1.0, 1.0, (robot.n, 20))
    rest = np.zeros_like(q)
    torque = np.abs(standard_regressor(robot, q, rest, rest)).max(axis=(1, 2))
    largest = float(torque.max(initial=0.0))
    return tuple(bool(largest > 0.0 and torque[j] > 1e-4 * largest and not robot.prismatic[j]) for j in range(robot.n))


@lru_cache(maxsize=32)
def _groups_of(names: tuple[str, ...]) -> tuple[frozenset[str], ...]:
    """Return groups of recordings, given in the order of time, that leave out the first."""
    everything = frozenset(names)
    words: dict[str, set[str]] = {}
    for name in names:
        trajectory, repetition = split_name(name)
        for word in {trajectory, f"repetition {repetition}", *re.split(r"[\W_]+", trajectory)}:
            words.setdefault(word, set()).add(name)
    proposals = [frozenset(group) for group in words.values()]
    proposals += [frozenset(names[k:]) for k in range(1, len(names))]
    proposals += [frozenset([name]) for name in names]
    # A group and its complement say the same; the one without the first recording counts what was added since.
    proposals = [everything - group if names[0] in group else group for group in proposals]
    return tuple(dict.fromkeys(group for group in proposals if group))[:MOST_GROUPS]
