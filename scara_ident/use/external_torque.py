"""The torque that acts on the arm from outside, sample by sample, without any acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm
from scara_ident.errors import UsageError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.terms import Friction, Offset, RigidBody, Term
from scara_ident.motion.motion import Motion
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.use.lossy_gears import LossyGears, is_lossy
from scara_ident.use.momentum import arm_momentum

# Cut-off of the observer, and of the low-pass on positions and efforts where velocities are not given, Hz.
BANDWIDTH, DIFFERENTIATOR = 4.0, 25.0
# Below this share of its usual largest speed a joint may stand still: Coulomb friction is then anything between both its
# values. Above the second it is fast.
REST_SHARE, FAST_SHARE = 0.02, 0.3
# What the uncertainty of the torque may depend on, see `ExternalTorque.features`.
FEATURES = (
    "fast, backwards", "slow, backwards", "at rest", "slow, forwards", "fast, forwards", "momentum rate", "effort",
    "momentum swing",
)  # fmt: skip
_RATE, _EFFORT, _SWING = 5, 6, 7
# States at which a term is compared with itself without acceleration and history, and how well it must agree.
_STATES, _AGREES = 40, 1e-9


@dataclass(frozen=True, eq=False)
class ObserverSettings:
    """What an observer of external torques needs beside the model.

    Attributes
    ----------
    speed : ndarray, shape (n,)
        Usual largest speed of each joint, rad/s or m/s.
    bandwidth : float
        Of the observer, Hz: its gain over 2 pi.
    differentiator : float
        Cut-off of the low-pass on positions and efforts where velocities are not given, Hz.
    """

    speed: Array
    bandwidth: float = BANDWIDTH
    differentiator: float = DIFFERENTIATOR


class ExternalTorque:
    """Observer of the torque from outside, on the side where effort is recorded.

    The momentum p of links and rotors obeys ``dp/dt = u - u_f + C^T v - g + u_ext``; the observer's residual is ``u_ext``
    after a first-order low-pass (De Luca and Mattone 2005). It is integrated over each step by the mean of its ends, and
    the low-pass exactly, so that any step is stable. Of a gear's loss see `LossyGears`.

    Parameters
    ----------
    known : IdentifiedModel
    settings : ObserverSettings

    Attributes
    ----------
    torque : ndarray, shape (n,)
        What acts from outside, recorded side, N m or N; a force f on the tool is ``J^T f`` of it.
    features : ndarray, shape (n, k)
        `FEATURES`, through the same low-pass: share of the time at rest, slow and fast by direction, and size of the
        momentum's rate, of the effort and of how fast that rate swings, where a velocity that lags shows; the uncertainty of
        the torque is made of these.
    left_out : tuple of str
        Effects of the model that take more than position and velocity, and are no part of it.
    """

    def __init__(self, known: IdentifiedModel, settings: ObserverSettings) -> None:
        robot = known.robot
        self.robot, self.settings = robot, settings
        self.arm = arm_momentum(known)
        self._scale = robot.row_scale
        self._rest, fast = REST_SHARE * settings.speed, FAST_SHARE * settings.speed
        self._edges = np.array([-fast, -self._rest, self._rest, fast])
        self._rows, self._none = np.arange(robot.n), np.zeros(robot.n)
        self._gain = 2.0 * np.pi * settings.bandwidth
        self._friction, self._offset = np.zeros((4, robot.n)), np.zeros(robot.n)
        self._others: list[tuple[Term, Array]] = []
        gears, left_out = [], []
        for term in known.model.terms:
            value = known.value[known.model.place(term)]
            if isinstance(term, Friction):
                for k, power in enumerate(term.powers):
                    # Of the joint's velocity, where the term has the drive's.
                    self._friction[power] = robot.drive_sign * value[k :: len(term.powers)]
            elif isinstance(term, Offset):
                self._offset = term.of_joints(value)
            elif isinstance(term, EffectTerm) and is_lossy(term, value):
                gears.append((term, value))
            elif not isinstance(term, RigidBody):
                if _of_position_and_velocity(term, robot.n):
                    self._others.append((term, value))
                else:
                    left_out.append(term.name)
        self.left_out = tuple(left_out)
        self._gears = LossyGears(robot, gears, settings.differentiator) if gears else None
        self.reset()

    def reset(self) -> None:
        """Forget all before, as after a gap."""
        self.torque = np.zeros(self.robot.n)
        self.features = np.zeros((self.robot.n, len(FEATURES)))
        self._before: tuple[Array, Array] | None = None
        self._seen: Array | None = None
        self._slopes = np.zeros((2, self.robot.n))
        self._slow_rate = np.zeros(self.robot.n)
        if self._gears is not None:
            self._gears.reset()

    def update(self, q: Array, v: Array | None, effort: Array, step: float) -> Array:
        """Take one sample and return `torque`.

        Parameters
        ----------
        q : ndarray, shape (n,)
            Positions in the robot's order, rad or m.
        v : ndarray, shape (n,), or None
            Velocities; None differentiates the positions through a low-pass, which effort then goes through too. It must
            be the one or the other always.
        effort : ndarray, shape (n,)
            As recorded, times ``effort_gain``: N m or N on the recorded side.
        step : float
            s since the sample before.
        """
        if v is None:
            q, v, effort = self._differentiated(q, effort, step)
        momentum, change = self.arm.at(q, v)
        square = v * v
        coefficients = self._friction
        friction = self._offset + v * (coefficients[1] + square * coefficients[3])
        along = np.minimum(1.0, np.maximum(-1.0, v / self._rest))
        friction += along * (coefficients[0] + square * coefficients[2])
        for term, value in self._others:
            friction += _torque_of(term, value, q, v)
        # Everything on the recorded side.
        momentum = self._scale * momentum
        drive, lost = effort - friction, self._none
        if self._gears is not None:
            drive, lost = self._gears.update(drive, q, v, along, step)
        force = drive + self._scale * change
        share, rate = 1.0, self._none
        if self._before is not None:
            share = -math.expm1(-self._gain * step)
            rate = (momentum - self._before[0]) / step
            self.torque = self.torque + share * (rate - lost - 0.5 * (force + self._before[1]) - self.torque)
        self._before = momentum, force
        features = (1.0 - share) * self.features
        features[self._rows, np.add.reduce(v > self._edges, axis=0)] += share
        features[:, _RATE] += share * np.abs(rate)
        features[:, _EFFORT] += share * np.abs(effort)
        self._slow_rate = self._slow_rate + share * (rate - self._slow_rate)
        features[:, _SWING] += share * np.abs(rate - self._slow_rate)
        self.features = features
        return self.torque

    def _differentiated(self, q: Array, effort: Array, step: float) -> tuple[Array, Array, Array]:
        """Pass positions and efforts through one critically damped low-pass, which has the velocity among its states."""
        now = np.array([q, effort])
        if self._seen is None:
            self._seen = now
            return q, np.zeros_like(q), effort
        w = 2.0 * np.pi * self.settings.differentiator
        decay = math.exp(-w * step)
        # Exact for an input that is held over the step.
        away = self._seen - now
        pull = self._slopes + w * away
        self._seen = now + decay * (away + pull * step)
        self._slopes = decay * (self._slopes - w * step * pull)
        return self._seen[0], self._slopes[0], self._seen[1]


def _torque_of(term: Term, value: Array, q: Array, v: Array) -> Array:
    """Return the torque of a term in one state, recorded side, shape (n,)."""
    state = Motion("", "", np.zeros(1), q[:, None], v[:, None], np.zeros((len(q), 1)), None, 1.0)
    return np.asarray(term.regressor(state)[:, :, 0] @ value)


def _of_position_and_velocity(term: Term, n: int) -> bool:
    """Whether a term's columns follow from position and velocity alone, without acceleration, time or what came before."""
    rng = np.random.default_rng(0)
    q, v, a = np.cumsum(rng.normal(0.0, 0.1, (n, _STATES)), axis=1), *rng.normal(0.0, 1.0, (2, n, _STATES))
    whole = term.regressor(Motion("", "", np.arange(float(_STATES)), q, v, a, None, 1.0))
    try:
        for k in range(_STATES):
            state = Motion("", "", np.zeros(1), q[:, k : k + 1], v[:, k : k + 1], np.zeros((n, 1)), None, 1.0)
            alone = term.regressor(state)[:, :, 0]
            if not np.allclose(alone, whole[:, :, k], rtol=_AGREES, atol=_AGREES * float(np.max(np.abs(whole)))):
                return False
    except (ValueError, IndexError):
        # It needs more than one sample.
        return False
    return True


@dataclass(frozen=True, eq=False)
class Observed:
    """What an observer made of a recording.

    Attributes
    ----------
    name : str
    time : ndarray, shape (N,)
        Since the recording began, s.
    position : ndarray, shape (n, N)
    torque : ndarray, shape (n, N)
        External torque, recorded side.
    features : ndarray, shape (n, k, N)
    settled : ndarray of bool, shape (N,)
        Away from the beginning and from gaps.
    """

    name: str
    time: Array
    position: Array
    torque: Array
    features: Array
    settled: np.typing.NDArray[np.bool_]


# Time constants of the observer after which it has forgotten how it began.
SETTLES = 10.0


def observe_recording(
    observer: ExternalTorque, name: str, time: Array, q: Array, v: Array | None, effort: Array
) -> Observed:
    """Run an observer over a recording; arrays of shape (n, N).

    Raises
    ------
    UsageError
        If there are fewer than two samples.
    """
    if len(time) < 2:
        raise UsageError(f"{name}: {len(time)} samples; contact needs a recording of two or more")
    observer.reset()
    steps = np.diff(time, prepend=time[0])
    gap = GAP_STEPS * float(np.median(steps[1:]))
    count = len(time)
    torque, settled = np.zeros(q.shape), np.zeros(count, dtype=bool)
    features = np.zeros((len(q), len(FEATURES), count))
    wait = SETTLES / (2.0 * np.pi * min(observer.settings.bandwidth, observer.settings.differentiator))
    since = 0.0
    positions, efforts = np.ascontiguousarray(q.T), np.ascontiguousarray(effort.T)
    velocities = None if v is None else np.ascontiguousarray(v.T)
    for k in range(count):
        step = float(steps[k])
        since += step
        if step > gap:
            observer.reset()
            since = 0.0
        torque[:, k] = observer.update(positions[k], None if velocities is None else velocities[k], efforts[k], step)
        features[:, :, k] = observer.features
        settled[k] = since > wait
    return Observed(name, time - time[0], q, torque, features, settled)
