"""Two masses at each elastic joint: its motor moves as recorded, and the link behind its gear follows.

With the links' positions q and the motors' theta, the lags x = theta - q follow from the links' rows of the equations of
motion (Spong 1987),

    tau_j(q, q', q'') = k_j x_j + d_j x_j'

where tau_j is the torque that the gear of joint j passes on to the links. Given the rigid bodies, stiffness and damping these
are ordinary differential equations for the lags of all elastic joints under the recorded motion of all motors: what one link
lags loads the gears of the others, and one after the other they could not be solved, as near a resonance the lags would grow
from turn to turn. They hold below, at and above the frequency sqrt(k / inertia), at which a link swings while its motor is
held. They are solved by Newton's method, each step of which is linear about the lags before it; so are their derivatives by
the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.links import (
    behind,
    held_link_inertia,
    lagging,
    lagging_at,
    lagging_slopes,
    link_slopes,
    moved_inertia,
    on_links_at,
    rigid_rows,
    rigid_torque,
    shared,
    usual_link_inertia,
    usual_link_inertia_slopes,
)
from scara_ident.effects.matrices import definite, times
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.effects.swing import InitialState, Lag, Swing, free_swings
from scara_ident.model.terms import joint_rows
from scara_ident.motion.motion import Motion

# Newton's steps, the first from no lag: each squares the error, which for the first is the lag itself in rad.
STEPS = 2
# Of a smaller lag, rad or m, what is of second order is this share of its torque and is left out, which saves most of the time.
SMALL_LAG = 5e-3
# Gravity does not take away more than the rest of a gear's stiffness.
MIN_STIFFNESS_SHARE = 0.1
# Radians (of a joint that slides as much of its travel, see `Scene.radian`): a link that lags by more has no gear, whose springs
# are wound by milliradians, by a few tenths in arms with springs on purpose. Newton's steps from there end nowhere.
MAX_LAG = 1.0
# A swing at the beginning is followed until no more than this share is left of it, and then for so many periods of the band.
FADED, FADED_PERIODS = 1e-6, 8.0

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class TwoMasses:
    """Motors and links of m joints on a stretch of motion.

    Attributes
    ----------
    members : tuple of Member
        Of each joint, in their order, the frequency in Hz of its link against its held motor, which with the link's usual
        inertia is the square root of stiffness over inertia, and the damping ratio of that swinging. Usual inertias are above 0.
    """

    signals: Signals
    members: tuple[Member, ...]

    @cached_property
    def joints(self) -> list[int]:
        """Their places."""
        return [member.place for member in self.members]

    @cached_property
    def inertia(self) -> Array:
        """Usual inertia of each link, at the joint, shape (m,)."""
        return np.array([usual_link_inertia(self.signals.scene, joint) for joint in self.joints])

    @cached_property
    def _turning(self) -> Array:
        """Frequency, rad/s, of each, shape (m,)."""
        return 2.0 * np.pi * np.array([member.nonlinear[0] for member in self.members])

    @cached_property
    def _ratio(self) -> Array:
        return np.array([member.nonlinear[1] for member in self.members])

    @property
    def stiffness(self) -> Array:
        """N m/rad or N/m, at the joint, shape (m,)."""
        return self.inertia * self._turning**2

    @property
    def damping(self) -> Array:
        """N m s/rad or N s/m, at the joint, shape (m,)."""
        return 2.0 * self._ratio * self._turning * self.inertia

    @cached_property
    def _scale(self) -> Array:
        return np.asarray(self.signals.scene.robot.row_scale[self.joints])

    @cached_property
    def _armature(self) -> Array:
        return np.array([self.signals.scene.armature(joint) for joint in self.joints])

    @property
    def swing(self) -> Swing:
        """The equations for the lags about no lag."""
        return self._kept("swing", lambda: self._swing(self._slopes(self.signals)))

    def _slopes(self, links: Signals) -> Lag:
        """Return derivatives of the torque of links by their positions, velocities and accelerations, each (m, m, N)."""
        own = self.joints
        each = [link_slopes(links, joint) for joint in own]
        by_q, by_v, by_a = (
            np.stack([slopes[k][own] / self._scale[:, None] for slopes in each], axis=1) for k in range(3)
        )
        for a, joint in enumerate(own):
            held = held_link_inertia(links, joint)
            # The slope by a link's own speed is the rate of its inertia: together they feed no swing, however large it is, but
            # where a poor estimate has the inertia held there is none.
            by_v[a, a] = np.where(held > by_a[a, a] - self._armature[a], 0.0, by_v[a, a])
            by_a[a, a] = held
        return by_q, by_v, definite(by_a)

    def _swing(self, slopes: Lag) -> Swing:
        spring, damping, inertia = (part.copy() for part in slopes)
        for a, (k, d) in enumerate(zip(self.stiffness, self.damping, strict=True)):
            spring[a, a] = np.maximum(k + spring[a, a], MIN_STIFFNESS_SHARE * k)
            damping[a, a] += d
        return Swing(inertia, damping, spring, 1.0 / self.signals.motion.rate)

    @property
    def lag(self) -> Lag:
        """Motors less links, and their first two derivatives, each (m, N)."""
        return self._solved[0]

    @property
    def _solved(self) -> tuple[Lag, Swing, Signals | None]:
        """The lags, the equations of the last of Newton's steps, and the motion that these are linear about if links lag there."""
        return self._kept("lag", self._made_lag)

    @property
    def held(self) -> bool:
        """Whether gears hold their links, see `MAX_LAG`. No arm is otherwise, and lags are NaN then."""
        return not bool(np.any(np.isnan(self.lag[0])))

    def _within_gears(self, lag: Lag) -> bool:
        # Not so either where they are NaN or infinite.
        most = MAX_LAG * self.signals.scene.radian[self.joints]
        return bool(np.all(np.max(np.abs(lag[0]), axis=1) <= most))

    def _made_lag(self) -> tuple[Lag, Swing, Signals | None]:
        signals, own, swing, links = self.signals, self.joints, self.swing, None
        lag = self._settled(swing, self._load(signals.rigid[own] + signals.on_links[own], signals.motion.a[own]))
        unheld = np.full(lag[0].shape, np.nan)
        if not self._within_gears(lag):
            return (unheld, unheld, unheld), swing, None
        recorded = signals.motion.torque
        if self._initial is not None and recorded is not None:
            left = recorded[own] - signals.predicted[own] - signals.on_links[own] - self._on_own(lag, signals)
            lag = self._initial.added(lag, self._initial.state(left, (lag[0], lag[1])))
        for _ in range(0 if _small(lag) else STEPS - 1):
            links = Signals(signals.scene, self._behind(lag, len(own)))
            each = self._slopes(links)
            swing = self._swing(each)
            load = self._load(self._torque(links.motion)[own], links.motion.a[own])
            for slopes, part in zip(each, lag, strict=True):
                load += times(slopes, part)
            lag = swing.solve(load, lag[0][:, :2])
            if not self._within_gears(lag):
                return (unheld, unheld, unheld), swing, None
            if self._initial is not None and recorded is not None:
                left = recorded[own] - signals.predicted[own] - signals.on_links[own] - self._changed(lag)[own]
                lag = self._initial.added(lag, self._initial.state(left, (lag[0], lag[1])))
        return lag, swing, links

    def _settled(self, swing: Swing, torque: Array) -> Lag:
        """Return the lags under torques (..., m, N), from rest where the swing at the beginning is looked for.

        Their first samples come from filtered positions of which nobody knows what was before, and may assume any speed.
        """
        if self._initial is None:
            return swing.solve(torque)
        return swing.solve(torque, np.repeat(swing.static(torque[..., :1]), 2, axis=-1))

    @property
    def _initial(self) -> InitialState | None:
        """What the recorded torque says of how links swung when the recording began; None where none was recorded."""
        return self._kept("initial state", self._made_initial)

    def _made_initial(self) -> InitialState | None:
        motion, band = self.signals.motion, self.signals.scene.band
        trim = int(np.ceil(motion.rate / band))
        if motion.torque is None or motion.samples <= 4 * trim:
            return None
        count = self.swing.memory(FADED) + int(FADED_PERIODS * motion.rate / band)
        count = max(min(count, motion.samples), 4 * trim)
        free = free_swings(self.swing, count)
        size = np.std(motion.torque[self.joints], axis=1)
        weights = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0) if len(size) > 1 else np.ones(1)
        fade = np.ones((len(size), count)) if motion.fade is None else motion.fade[self.joints, :count]
        used = slice(trim, min(count, motion.samples - trim))
        return InitialState(free, self._on_own(free, self.signals), weights, fade, motion.rate, band, used)

    @property
    def change(self) -> Array:
        """Torque of all joints less that with rigid gears, recorded side, shape (n, N); 0 where these do not hold."""
        return self._kept("change", self._made_change)

    def _made_change(self) -> Array:
        if not self.held:
            return np.zeros_like(self.signals.motion.q)
        if _small(self.lag):
            return np.asarray(sum(self.parts))
        return self._changed(self.lag)

    def _changed(self, lag: Lag) -> Array:
        """Return what lags change of all torques, of all orders."""
        result = self._torque(self._behind(lag, len(self.joints))) - self.signals.rigid - self.signals.on_links
        result[self.joints] += (self._scale * self._armature)[:, None] * lag[2]
        return np.asarray(result)

    @property
    def parts(self) -> list[Array]:
        """What each link adds to `change` once those before it lag too, recorded side, shape (n, N) each."""
        return self._kept("parts", self._made_parts)

    def _made_parts(self) -> list[Array]:
        x, first, second = self.lag
        if not self.held:
            return [np.zeros_like(self.signals.motion.q) for _ in self.joints]
        if _small(self.lag):
            return [lagging(self.signals, j, (x[a], first[a], second[a])) for a, j in enumerate(self.joints)]
        found, before = [], self.signals.rigid + self.signals.on_links
        for a, j in enumerate(self.joints):
            torque = self._torque(self._behind(self.lag, a + 1))
            found.append(torque - before)
            found[a][j] += self._scale[a] * self._armature[a] * second[a]
            before = torque
        return found

    def slopes(self, place: int) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Give of each joint derivatives of what all links do to its torque, see `Effect.slopes`, for the member of a place.

        They are by its armature where the bodies do not tell it, its frequency and its damping ratio, and with the first
        member by the parameters of the rigid bodies. To them comes what its coefficient takes away in turn, see `Tie`: so
        the sums over all members are the derivatives of `change`, whatever is shared out between them.
        """
        if not self.held:
            return
        scene, motion, own = self.signals.scene, self.signals.motion, self.joints
        term, carrier = scene.model.rigid_body, place == 0
        (x, first, second), swing, lagging_links = self._solved
        # Nothing that is kept for signals may hold these.
        links = self.signals if lagging_links is None else lagging_links
        p, moved = term.pattern.shape[1], self._behind(self.lag, len(own))
        bodies = joint_rows(term, moved) if carrier else []
        rotors, usual = np.zeros((2, len(own), p + 3))
        share = np.zeros(p + 3)
        share[:p] = usual_link_inertia_slopes(scene, own[place])
        share[p], share[p + 1] = -1.0, 2.0 * self.inertia[place] / self.members[place].nonlinear[0]
        share /= self.inertia[place]
        rotors[place, p], usual[place, p] = 1.0, -1.0
        if carrier:
            rotors[:, :p] = [scene.armature_slopes(joint) for joint in own]
            usual[:, :p] = [usual_link_inertia_slopes(scene, joint) for joint in own]
        columns = [np.flatnonzero(term.pattern[joint]) for joint in own] if carrier else []
        acting = np.flatnonzero(np.any((rotors != 0.0) | (usual != 0.0), axis=0))
        acting = np.unique(np.concatenate([acting, *columns, [p + 1, p + 2]]))
        # Torques that the parameters put into the gears, and by rotors, which few have, directly into the joints' torque.
        turning, ratio = self._turning, self._ratio
        right = np.zeros((len(acting), len(own), motion.samples))
        for a, joint in enumerate(own):
            turned, held = rotors[a, acting, None], usual[a, acting, None]
            right[:, a] = -turned * moved.a[joint] - held * (
                turning[a] ** 2 * x[a] + 2.0 * ratio[a] * turning[a] * first[a]
            )
            if carrier:
                at = np.searchsorted(acting, columns[a])
                right[at, a] += bodies[joint] / self._scale[a]
        inertia = self.inertia[place]
        right[-2, place] = -4.0 * np.pi * inertia * (turning[place] * x[place] + ratio[place] * first[place])
        right[-1, place] = -2.0 * turning[place] * inertia * first[place]
        lags = self._settled(swing, right)
        # As large as each of them.
        del right
        direct = self._scale[:, None] * rotors[:, acting]
        each = [(lags[0][:, a], lags[1][:, a], lags[2][:, a]) for a in range(len(own))]
        about = [link_slopes(links, joint) for joint in own]
        count, state = 0, np.zeros((0, 0))
        if self._initial is not None:
            # The swing at the beginning is fitted again whatever the parameters are.
            count = self._initial.count
            whole = self._on_own((lags[0][..., :count], lags[1][..., :count], lags[2][..., :count]), links)
            whole += direct.T[..., None] * second[:, :count]
            for a, at in enumerate(columns):
                whole[np.searchsorted(acting, at), a] += bodies[own[a]][:, :count]
            state = self._initial.state(whole, (x, first))
        shared_out = np.flatnonzero(share)
        for joint in range(scene.robot.n):
            body = np.flatnonzero(term.pattern[joint]) if carrier else shared_out[:0]
            places = np.union1d(np.union1d(body, acting), shared_out)
            result, at = np.zeros((len(places), motion.samples)), np.searchsorted(places, acting)
            result[at] = lagging_slopes(self.signals, joint, own, about, each)
            if carrier:
                result[np.searchsorted(places, body)] += bodies[joint] - rigid_rows(self.signals)[joint]
            if joint in own:
                a = own.index(joint)
                by_rotor = np.flatnonzero(direct[a])
                result[at[by_rotor]] += direct[a, by_rotor, None] * second[a]
            if count:
                result[at, :count] -= state @ self._begun[:, joint]
            result[np.searchsorted(places, shared_out)] += share[shared_out, None] * self.parts[place][joint]
            yield places, result

    @property
    def _begun(self) -> Array:
        """What each unit of how links swung when the recording began changes of all torques, shape (2 m, n, M)."""
        return self._kept("begun", self._made_begun)

    def _made_begun(self) -> Array:
        assert self._initial is not None
        links, free = self._solved[2], self._initial.free
        links = self.signals if links is None else links
        each = [(free[0][:, a], free[1][:, a], free[2][:, a]) for a in range(len(self.joints))]
        torques = [
            sum(lagging_at(links, place, joint, own) for joint, own in zip(self.joints, each, strict=True))
            for place in range(self.signals.scene.robot.n)
        ]
        return np.stack([np.asarray(torque) for torque in torques], axis=1)

    def _on_own(self, lag: Lag, links: Signals) -> Array:
        """Return what lags (..., m, N) change of their joints' torques, recorded side, (..., m, N), to first order about links."""
        result = np.zeros(lag[0].shape)
        for b, joint in enumerate(self.joints):
            own = lag[0][..., b, :], lag[1][..., b, :], lag[2][..., b, :]
            for a, other in enumerate(self.joints):
                result[..., a, :] += lagging_at(links, other, joint, own)
        return result

    def _behind(self, lag: Lag, count: int) -> Motion:
        """Return the motion with so many of the links in place of their motors."""
        motion = self.signals.motion
        for a, joint in enumerate(self.joints[:count]):
            motion = behind(motion, joint, (lag[0][a], lag[1][a], lag[2][a]))
        return motion

    def _torque(self, motion: Motion) -> Array:
        state = (motion.q, motion.v, motion.a)
        found = rigid_torque(self.signals.scene, motion, *state)
        return found + on_links_at(self.signals, *state) if self.signals.scene.link_torques else found

    def _load(self, torque: Array, acceleration: Array) -> Array:
        """Return the torques (m, N) that the gears pass on, at the joints, of those with the rotors on the links."""
        return np.asarray(torque / self._scale[:, None] - self._armature[:, None] * acceleration)

    def _kept(self, name: str, make: Callable[[], T]) -> T:
        """Return what every member of a model asks for, made once for the signals; of a candidate nobody asks again."""
        if self.members == tuple(member for _, member in self.signals.scene.together):
            return shared(self.signals, (name, self.members), make)
        held: dict[str, T] = self.__dict__.setdefault("_own", {})
        if name not in held:
            held[name] = make()
        return held[name]


def usual_coupling(scene: Scene, joint: int, other: int) -> float:
    """Return the inertia that two links share over the mean of their own, rms over poses; 0 where misjudged."""
    own = usual_link_inertia(scene, joint), usual_link_inertia(scene, other)
    if not min(own) > 0.0:
        return 0.0
    return float(np.sqrt(np.mean(moved_inertia(scene, joint, other) ** 2) / (own[0] * own[1])))


def _small(lag: Lag) -> bool:
    return bool(np.max(np.abs(lag[0])) < SMALL_LAG)
