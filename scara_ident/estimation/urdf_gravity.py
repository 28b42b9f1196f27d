"""Gravity as the efforts show it with the URDF's bodies: whether it is there, and its direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import triangular
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.urdf_scale import SIGNIFICANT_STDS, USUAL
from scara_ident.model.urdf_torque import urdf_torques

# Gravity of less than this share of the stated one is none: a controller subtracts it as well as it knows masses.
NONE = 0.15
# Another direction is reported where it leaves at most this share of the rms that the stated one leaves, over all joints, each in
# units of what it leaves where gravity and inertia are free for it alone; rough masses leave as much along any direction.
FAR_LESS = 0.5
# A base that leans by less than this, degrees, may stand so in truth; that is an effect, and is looked for as one.
TURNED = 15.0
# Arms are mounted square: so many degrees are what rough masses make of it.
SQUARE = 3.0
# Directions of columns below this share of the largest are rounding.
RANK = 1e-9
# Components of gravity whose torque is below this share of the largest do not show: angles of few digits in a URDF make as much.
SHOWN = 1e-3


@dataclass(frozen=True, eq=False)
class UrdfGravity:
    """Gravity by which the URDF's bodies, with free friction, offsets and rotors, leave least of the efforts.

    Attributes
    ----------
    stated, found : ndarray, shape (3,)
        m/s^2, in the frame of the base.
    covariance : ndarray, shape (3, 3)
        Of ``found``, by what is left.
    inertia, inertia_std : float
        Torque of inertia, in all joints, as a multiple of the URDF's.
    left, stated_left : float
        Rms of what is left, and with gravity along the stated direction, of whatever size; both in units of what the joints
        leave each for itself.
    """

    stated: Array
    found: Array
    covariance: Array
    inertia: float
    inertia_std: float
    left: float
    stated_left: float

    @property
    def degrees(self) -> float:
        """Angle between gravity as found and as stated."""
        return angle(self.found, self.stated)

    @property
    def missing(self) -> bool:
        """Whether the efforts hold no gravity, where they hold the inertia of the URDF."""
        size = np.linalg.norm(self.stated)
        along = self.stated / size
        std = np.sqrt(along @ self.covariance @ along)
        return bool(
            self._as_heavy and np.linalg.norm(self.found) < NONE * size and SIGNIFICANT_STDS * std < NONE * size
        )

    @property
    def elsewhere(self) -> bool:
        """Whether gravity of another direction leaves far less."""
        size, found = np.linalg.norm(self.stated), np.linalg.norm(self.found)
        return bool(
            # Gravity the other way round is a ceiling, or efforts of opposite sign, which inertia tells apart.
            self._as_heavy
            and size / USUAL < found < size * USUAL
            and np.sqrt(np.max(np.linalg.eigvalsh(self.covariance))) * SIGNIFICANT_STDS
            < found * np.sin(np.radians(TURNED))
            and self.degrees > TURNED
            and self.left < FAR_LESS * self.stated_left
        )

    @property
    def borne_out(self) -> bool:
        """Whether the URDF's bodies show gravity about as stated."""
        size, found = np.linalg.norm(self.stated), np.linalg.norm(self.found)
        return bool(size / USUAL < found < size * USUAL and self.degrees < TURNED)

    @property
    def turned(self) -> bool:
        """Whether gravity and inertia are both the other way round, as of efforts of opposite sign."""
        size, found = np.linalg.norm(self.stated), np.linalg.norm(self.found)
        return bool(
            1.0 / USUAL < -self.inertia < USUAL
            and -self.inertia > SIGNIFICANT_STDS * self.inertia_std
            and size / USUAL < found < size * USUAL
            and np.sqrt(np.max(np.linalg.eigvalsh(self.covariance))) * SIGNIFICANT_STDS
            < found * np.sin(np.radians(TURNED))
            and self.degrees > 180.0 - TURNED
            and self.left < FAR_LESS * self.stated_left
        )

    @property
    def _as_heavy(self) -> bool:
        """Whether inertia is determined, and about that of the URDF."""
        return 1.0 / USUAL < self.inertia < USUAL and self.inertia > SIGNIFICANT_STDS * self.inertia_std


def urdf_gravity(observations: Observations) -> UrdfGravity | None:
    """Fit gravity with the URDF's bodies; None where no joint would show any that is stated, or no row is left.

    Parameters
    ----------
    observations : Observations
        Of a model without effects; kept for whoever asks again.
    """
    observations = observations.in_memory
    known: dict[str, Any] = observations.__dict__
    if "_urdf_gravity" not in known:
        known["_urdf_gravity"] = _fitted(observations)
    found: UrdfGravity | None = known["_urdf_gravity"]
    return found


def gravity_sentence(gravity: UrdfGravity | None) -> str | None:
    """Say where gravity is not what the description says."""
    if gravity is None:
        return None
    if gravity.missing:
        return (
            "These efforts contain the inertia of the URDF but no gravity: the controller may subtract gravity, or "
            "springs may carry the weight; log the whole effort, or state gravity: [0, 0, 0] in robot.yaml."
        )
    if gravity.elsewhere:
        return elsewhere_sentence(near_axis(gravity.found / np.linalg.norm(gravity.found)), gravity.stated)
    return None


def elsewhere_sentence(along: Array, stated: Array) -> str:
    """Say that gravity points along a direction of length 1, and what to state."""
    state = float(np.linalg.norm(stated)) * along
    return (
        f"Gravity seems to point along {_listed(along)} of the base, {angle(along, stated):.0f} degrees from the "
        f"direction in the robot description: if the arm is mounted so, state gravity: {_listed(state)} in robot.yaml; "
        f"otherwise the zero of a joint's position may differ from the URDF's, such as by half a turn of the shoulder "
        f"(recording, position: offset)."
    )


def angle(one: Array, other: Array) -> float:
    """Return the angle between two directions, degrees."""
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def near_axis(along: Array) -> Array:
    """Return the axis of the base that a direction of length 1 is close to, or the direction itself."""
    place = int(np.argmax(np.abs(along)))
    axis = np.sign(along[place]) * np.eye(3)[place]
    return axis if angle(along, axis) < SQUARE else along


def _listed(vector: Array) -> str:
    # Adding nothing takes the sign off what is rounded to zero.
    return f"[{', '.join(f'{part:.3g}' for part in np.round(vector, 2) + 0.0)}]"


def _fitted(observations: Observations) -> UrdfGravity | None:
    robot = observations.model.robot
    stated = np.asarray(robot.model.gravity.linear, dtype=float)
    size = float(np.linalg.norm(stated))
    if not size > 0.0:
        return None
    free = np.ones(observations.parameters, dtype=bool)
    free[observations.model.place(observations.model.rigid_body)] = False
    parts = [part for part in observations.data.stretches if part.usable]
    torques = [urdf_torques(robot, part.motion) for part in parts]
    shared, rights, rows = [], [], 0
    for j, own in enumerate(observations.joints):
        made = [
            part.rows(j, np.vstack([torque[j], part.motion.a[j]])) for part, torque in zip(parts, torques, strict=True)
        ]
        mine = np.concatenate(made, axis=1)
        count = mine.shape[1]
        # Friction, offset and rotor are nobody else's, so that what they do not explain is all that matters.
        table = np.concatenate([own.table[:-1][free[own.columns]], mine[4:], mine[:4], own.table[-1:]])
        if count < len(table):
            continue
        factor = triangular(table.T)
        outside = _outside(factor[:, :-5], factor[:, -5:])
        alone = outside[:, 4] - outside[:, :4] @ np.linalg.lstsq(outside[:, :4], outside[:, 4], rcond=RANK)[0]
        noise = float(np.sqrt(alone @ alone / count))
        if noise > 0.0:
            shared.append(outside[:, :4] / noise)
            rights.append(outside[:, 4] / noise)
            rows += count
    if not shared:
        return None
    columns, torque = np.concatenate(shared), np.concatenate(rights)
    # On upright axes gravity makes no torque.
    if not np.linalg.norm(columns[:, 1:] @ stated) > RANK * np.linalg.norm(columns[:, 0]):
        return None
    # Along the axes of a pendulum nothing shows of gravity; there it is taken as stated.
    _, shown, axes = np.linalg.svd(columns[:, 1:], full_matrices=False)
    seen = axes[shown > SHOWN * shown[0]]
    value, covariance, left = _solved(np.column_stack([columns[:, 0], columns[:, 1:] @ seen.T]), torque, rows)
    if not np.all(np.isfinite(covariance)):
        return None
    along = np.column_stack([columns[:, 0], columns[:, 1:] @ stated / size])
    as_stated, _, stated_left = _solved(along, torque, rows)
    if as_stated[1] < 0.0:
        # The other way round is another direction.
        _, _, stated_left = _solved(along[:, :1], torque, rows)
    found = stated + seen.T @ (value[1:] - seen @ stated)
    spread = seen.T @ covariance[1:, 1:] @ seen
    return UrdfGravity(stated, found, spread, float(value[0]), float(np.sqrt(covariance[0, 0])), left, stated_left)


def _outside(columns: Array, signals: Array) -> Array:
    """Return what columns do not explain of signals."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    return signals - scaled @ np.linalg.lstsq(scaled, signals, rcond=RANK)[0]


def _solved(columns: Array, torque: Array, rows: int) -> tuple[Array, Array, float]:
    """Return least-squares values, their covariance, infinite where some are not determined, and the rms over so many rows of what is left."""
    size = np.linalg.norm(columns, axis=0)
    scale = 1.0 / np.where(size > 0.0, size, 1.0)
    value, _, rank, _ = np.linalg.lstsq(columns * scale, torque, rcond=1e-6)
    left = torque - (columns * scale) @ value
    mean = float(left @ left) / rows
    if rank < columns.shape[1]:
        return scale * value, np.full((len(scale),) * 2, np.inf), float(np.sqrt(mean))
    covariance = mean * np.linalg.inv((columns * scale).T @ (columns * scale))
    return scale * value, scale[:, None] * covariance * scale, float(np.sqrt(mean))
