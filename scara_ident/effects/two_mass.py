"""Two masses at one joint: the motor moves as recorded, and the link behind its elastic gear follows.

With the link's position q and the motor's theta, the lag x = theta - q follows from the link's row of the equations of
motion (Spong 1987),

    tau_j(q, q', q'') = k x + d x'

where tau_j is the torque that the gear passes on to the links. Given the rigid bodies, stiffness and damping this is an
ordinary differential equation for x under the recorded motion of all motors. It holds below, at and above the frequency
sqrt(k / inertia), at which the link swings while its motor is held. It is solved by Newton's method, each step of which is
linear in x; so are its derivatives by the parameters of the rigid bodies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.links import (
    behind,
    held_link_inertia,
    lagging,
    lagging_slopes,
    link_slopes,
    on_links_at,
    own_lagging,
    rigid_torque,
    usual_link_inertia,
    usual_link_inertia_slopes,
)
from scara_ident.effects.signals import Signals
from scara_ident.model.terms import joint_rows
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.motion import Motion

# Newton's steps, the first from no lag: each squares the error, which for the first is the lag itself in rad.
STEPS = 2
# Of a smaller lag, rad or m, what is of second order is this share of its torque and is left out, which saves most of the time.
SMALL_LAG = 5e-3
# Radians of the free swing per sample up to which the scheme of fourth order is taken; it is stable up to 2.45.
FINE_STEP = 2.0
# Gravity does not take away more than the rest of a gear's stiffness.
LEAST_SPRING = 0.1
# A swing at the beginning that is seen with less than this share of the other one's strength is not looked for.
UNSEEN = 1e-3
# It is followed until no more than this share is left of it, and then for so many periods of the band.
FADED, FADED_PERIODS = 1e-9, 8.0

Lag = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class TwoMasses:
    """A joint's motor and link on a stretch of motion.

    Attributes
    ----------
    frequency : float
        Of the link against its held motor, Hz: with its usual inertia it is the square root of stiffness over inertia.
    damping_ratio : float
        Of that swinging.
    """

    signals: Signals
    joint: int
    frequency: float
    damping_ratio: float

    @cached_property
    def inertia(self) -> float:
        """Usual inertia of the link, at the joint; not above 0 where misjudged."""
        return usual_link_inertia(self.signals.scene, self.joint)

    @property
    def stiffness(self) -> float:
        """N m/rad or N/m, at the joint."""
        return self.inertia * (2.0 * np.pi * self.frequency) ** 2

    @property
    def damping(self) -> float:
        """N m s/rad or N s/m, at the joint."""
        return 4.0 * np.pi * self.damping_ratio * self.frequency * self.inertia

    @cached_property
    def _slopes(self) -> Lag:
        """Derivatives of the torque of the links by position, velocity and acceleration, at the joint, each (N,)."""
        signals, j = self.signals, self.joint
        by_q, by_v = (slope[j] / signals.scene.robot.row_scale[j] for slope in link_slopes(signals, j)[:2])
        return by_q, by_v, held_link_inertia(signals, j)

    @cached_property
    def swing(self) -> Swing:
        """The equation for x about no lag."""
        by_q, by_v, by_a = self._slopes
        spring = np.maximum(self.stiffness + by_q, LEAST_SPRING * self.stiffness)
        # Coriolis torques of a poor estimate must not feed the swing.
        damping = np.maximum(self.damping + by_v, 0.0)
        return Swing(by_a, damping, spring, 1.0 / self.signals.motion.rate)

    @cached_property
    def lag(self) -> Lag:
        """Motor less link, and its first two derivatives, each (N,)."""
        links = self.signals.rigid[self.joint] + self.signals.on_links[self.joint]
        lag = self._settled(self._load(links, self.signals.motion.a[self.joint]))
        recorded = self.signals.motion.torque
        if self._initial is not None and recorded is not None:
            signals, j = self.signals, self.joint
            left = recorded[j] - signals.predicted[j] - signals.on_links[j] - own_lagging(signals, j, lag)
            lag = self._initial.added(lag, self._initial.state(left, (lag[0], lag[1])))
        for _ in range(0 if _small(lag) else STEPS - 1):
            moved = behind(self.signals.motion, self.joint, lag)
            load = self._load(self._torque(moved)[self.joint], moved.a[self.joint])
            by_q, by_v, by_a = self._slopes
            lag = self.swing.solve(load + by_q * lag[0] + by_v * lag[1] + by_a * lag[2], lag[0][:2])
        return lag

    def _settled(self, torque: Array) -> Lag:
        """Return the lags under torques (..., N), from rest where the swing at the beginning is looked for.

        Their first samples come from filtered positions of which nobody knows what was before, and may assume any speed.
        """
        if self._initial is None:
            return self.swing.solve(torque)
        return self.swing.solve(torque, np.repeat(torque[..., :1] / self.swing.stiffness[0], 2, axis=-1))

    @cached_property
    def _initial(self) -> InitialState | None:
        """What the recorded torque says of how the link swung when the recording began; None where none was recorded."""
        signals, j = self.signals, self.joint
        trim = int(np.ceil(signals.motion.rate / signals.scene.band))
        if signals.motion.torque is None or signals.motion.samples <= 4 * trim:
            return None
        count = self.swing.memory(FADED) + int(FADED_PERIODS * signals.motion.rate / signals.scene.band)
        count = max(min(count, signals.motion.samples), 4 * trim)
        free = self.swing.solve(np.zeros((2, count)), np.array([[1.0, 1.0], [0.0, self.swing.step]]))
        return InitialState(
            free,
            own_lagging(signals, j, free),
            signals.motion.rate,
            signals.scene.band,
            slice(trim, min(count, signals.motion.samples - trim)),
        )

    @cached_property
    def change(self) -> Array:
        """Torque of all joints less that with a rigid gear, recorded side, shape (n, N)."""
        scene, j = self.signals.scene, self.joint
        if _small(self.lag):
            return lagging(self.signals, j, self.lag)
        result = self._torque(behind(self.signals.motion, self.joint, self.lag)) - self.signals.rigid
        result -= self.signals.on_links
        result[j] += scene.robot.row_scale[j] * scene.armature(j) * self.lag[2]
        return np.asarray(result)

    def slopes(self) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Give of each joint the derivatives of stiffness times `change`, over the stiffness, see `Effect.slopes`.

        They are by the parameters of the rigid bodies, by the armature where these do not tell it, by the frequency and by
        the damping ratio.
        """
        scene, motion, j = self.signals.scene, self.signals.motion, self.joint
        term, scale = scene.model.rigid_body, scene.robot.row_scale[j]
        moved, (x, first, second) = behind(motion, j, self.lag), self.lag
        bodies = joint_rows(term, moved)
        own = np.flatnonzero(term.pattern[j])
        p = term.pattern.shape[1]
        rotor, usual, share = np.zeros((3, p + 3))
        rotor[: p + 1] = *scene.armature_slopes(j), 1.0
        usual[: p + 1] = *usual_link_inertia_slopes(scene, j), -1.0
        share[: p + 1], share[p + 1] = usual[: p + 1] / self.inertia, 2.0 / self.frequency
        acting = np.union1d(own, np.append(np.flatnonzero((rotor != 0.0) | (usual != 0.0)), [p + 1, p + 2]))
        omega, ratio = 2.0 * np.pi * self.frequency, self.damping_ratio
        right = -rotor[acting, None] * moved.a[j] - usual[acting, None] * (omega**2 * x + 2.0 * ratio * omega * first)
        right[np.searchsorted(acting, own)] += bodies[j] / scale
        right[-2] = -4.0 * np.pi * self.inertia * (omega * x + ratio * first)
        right[-1] = -2.0 * omega * self.inertia * first
        lags = self._settled(right)
        begun = None
        if self._initial is not None:
            # The swing at the beginning is fitted again whatever the parameters are.
            count = self._initial.count
            whole = own_lagging(self.signals, j, (lags[0][:, :count], lags[1][:, :count], lags[2][:, :count]))
            whole[np.searchsorted(acting, own)] += bodies[j][:, :count]
            whole += scale * rotor[acting, None] * second[:count]
            free = self._initial.free
            added = [lagging(self.signals, j, (free[0][k], free[1][k], free[2][k])) for k in range(2)]
            begun = self._initial.state(whole, (x, first)), np.array(added)
        for joint, (places, rows) in enumerate(lagging_slopes(self.signals, j, bodies, acting, lags)):
            change = share[acting, None] * self.change[joint]
            if joint == j:
                change += scale * rotor[acting, None] * second
            if begun is not None:
                state, torque = begun
                change[:, : torque.shape[-1]] -= state @ torque[:, joint]
            rows[np.searchsorted(places, acting)] += change
            yield places, rows

    def _torque(self, motion: Motion) -> Array:
        state = (motion.q, motion.v, motion.a)
        found = rigid_torque(self.signals.scene, motion, *state)
        return found + on_links_at(self.signals, *state) if self.signals.scene.link_torques else found

    def _load(self, torque: Array, acceleration: Array) -> Array:
        """Return the torque that the gear passes on, at the joint, of that with the rotor on the link."""
        scene, j = self.signals.scene, self.joint
        return np.asarray(torque / scene.robot.row_scale[j] - scene.armature(j) * acceleration)


def _small(lag: Lag) -> bool:
    return bool(np.max(np.abs(lag[0])) < SMALL_LAG)


@dataclass(frozen=True, eq=False)
class InitialState:
    """How a link swung when a recording began, as far as the torque of its joint says.

    Attributes
    ----------
    free : tuple of ndarray, each of shape (2, M)
        x and its derivatives after a unit of x, and of its derivative, at the first sample; after M samples it has faded.
    torque : ndarray, shape (2, M)
        What they add to the torque of the joint.
    rate, band : float
        Hz; the torque is looked at within the band.
    used : slice
        Samples away from the ends, where the continuation of filtered signals is a guess.
    """

    free: Lag
    torque: Array
    rate: float
    band: float
    used: slice

    @property
    def count(self) -> int:
        """Samples M."""
        return int(self.torque.shape[-1])

    @cached_property
    def _seen(self) -> Array:
        return low_pass(self.torque, self.rate, self.band)[:, self.used]

    def state(self, torque: Array, lag: tuple[Array, Array]) -> Array:
        """Return x and its derivative, beside those assumed, that explain a torque of the joint.

        Parameters
        ----------
        torque : ndarray, shape (..., N)
            Of which the first M samples are taken.
        lag : tuple of ndarray, shape (N,)
            x and its derivative, as large as which a swing at the beginning may be.

        Returns
        -------
        ndarray, shape (..., 2)
        """
        left = low_pass(torque[..., : self.count], self.rate, self.band)[..., self.used]
        sizes = np.array([np.mean(part**2) for part in lag])
        normal = self._seen @ self._seen.T
        # What cannot be seen stays as assumed.
        normal += np.diag(UNSEEN * np.trace(normal * sizes) / sizes)
        told = np.linalg.inv(normal)
        # Once more on what that leaves: of what is seen a thousandth would stay as assumed, for as long as it swings.
        once = left @ self._seen.T @ told
        return np.asarray(once + (left - once @ self._seen) @ self._seen.T @ told)

    def added(self, lag: Lag, state: Array) -> Lag:
        """Return x and its derivatives with the swing that a state at the first sample makes."""
        x, first, second = (part.copy() for part in lag)
        for part, own in zip((x, first, second), self.free, strict=True):
            part[: self.count] += state @ own
        return x, first, second


@dataclass(frozen=True, eq=False)
class Swing:
    """The equation ``inertia x'' + damping x' + stiffness x = torque`` at uniform samples.

    Attributes
    ----------
    inertia, damping, stiffness : ndarray, shape (N,)
    step : float
        s per sample.
    """

    inertia: Array
    damping: Array
    stiffness: Array
    step: float

    def solve(self, torque: Array, start: Array | None = None) -> Lag:
        """Return x, its derivative and its second derivative.

        Parameters
        ----------
        torque : ndarray, shape (..., N)
            N at least 3; may be of the first samples alone.
        start : ndarray, shape (..., 2), optional
            x at the first two samples, by default the static x.

        Returns
        -------
        tuple of ndarray, each of that shape

        Notes
        -----
        Newmark's method as one banded triangular system: the scheme of Fox and Goodwin, of fourth order in the frequency,
        where it is stable, else the constant mean acceleration, which always is (Hughes, The Finite Element Method, 2000,
        section 9.1).
        """
        from scipy.linalg.lapack import dtbtrs

        shape, (beta, bands) = np.shape(torque), self._system
        inertia, damping, stiffness = (part[: shape[-1]] for part in (self.inertia, self.damping, self.stiffness))
        rows = np.reshape(torque, (-1, shape[-1]))
        right = np.empty(rows.shape)
        right[:, :2] = rows[:, :2] / self.stiffness[:2] if start is None else np.reshape(start, (-1, 2))
        right[:, 2:] = beta * (rows[:, 2:] + rows[:, :-2]) + (1.0 - 2.0 * beta) * rows[:, 1:-1]
        # Row after row: a solver that exchanges rows takes five times as long and loses digits to the length of the run.
        x = np.asarray(dtbtrs(bands[:, : shape[-1]], right.T, uplo="L", overwrite_b=True)[0]).T
        first = np.gradient(x, self.step, axis=1)
        second = (rows - damping * first - stiffness * x) / inertia
        return x.reshape(shape), first.reshape(shape), second.reshape(shape)

    def memory(self, share: float) -> int:
        """Return after how many samples no more than a share is left of a free swing; all if it does not fade so far."""
        # An overdamped link creeps back at no less than the stiffness over the damping.
        swinging, creeping = self.damping * self.stiffness, 2.0 * self.inertia * self.stiffness
        fading = swinging / np.maximum(creeping, self.damping**2)
        return int(np.searchsorted(np.cumsum(fading) * self.step, -np.log(share)))

    @cached_property
    def _system(self) -> tuple[float, Array]:
        """Newmark's beta, and the diagonals of the triangular system, shape (3, N)."""
        fastest = float(np.max(self.stiffness / self.inertia)) * self.step**2
        beta = 1.0 / 12.0 if fastest < FINE_STEP**2 else 0.25
        heavy, slow = self.inertia[1:-1] / self.step**2, self.damping[1:-1] / (2.0 * self.step)
        spring = self.stiffness[1:-1]
        bands = np.ones((3, len(self.inertia)), order="F")
        bands[0, 2:] = heavy + slow + beta * spring
        bands[1, 1:-1] = -2.0 * heavy + (1.0 - 2.0 * beta) * spring
        bands[1, 0] = 0.0
        bands[2, :-2] = heavy - slow + beta * spring
        return beta, bands
