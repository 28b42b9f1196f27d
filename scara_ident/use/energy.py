"""What a motion costs: power of the drives, energy taken and given back, heat of the gears."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.motion.motion import Motion

# A power of the other sign below this share of the largest is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Drive:
    """Torque and power of the drives along a gapless motion.

    Attributes
    ----------
    motion : Motion
    parts : mapping of str to ndarray, shape (n, N)
        Torque by what it comes from, recorded side, see `IdentifiedModel.torque_parts`.
    row_scale : ndarray, shape (n,)
        Recorded torque per torque at the joint.
    """

    motion: Motion
    parts: Mapping[str, Array]
    row_scale: Array

    @property
    def torque(self) -> Array:
        """Torque of the drives, recorded side, N m or N, shape (n, N)."""
        return np.asarray(sum(self.parts.values()))

    def power_of(self, torque: Array) -> Array:
        """Return the power of a torque of the recorded side, W, shape (n, N): the same on both sides of the gear."""
        return np.asarray(torque * self.motion.v / self.row_scale[:, None])

    @property
    def power(self) -> Array:
        """Mechanical power that the drives give, W, shape (n, N); negative where they brake."""
        return self.power_of(self.torque)

    def work(self, power: Array) -> Array:
        """Return the integral of a power over time by the trapezoidal rule, J, shape (n,)."""
        return np.asarray(np.trapezoid(power, self.motion.time, axis=1))


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy of every joint along a motion, at the drives' shafts.

    ``given - returned`` is the sum of ``work``.

    Attributes
    ----------
    given, returned : ndarray, shape (n,)
        What the drives put in where their power is positive, and take back where they brake, J.
    work : mapping of str to ndarray, shape (n,)
        Net work by part of the torque, J.
    heat : tuple of str
        Parts that become heat: their power never changes its sign on a joint, so that nothing of it comes back. A negative
        one corrects another, as quadratic friction does viscous friction.
    rms_torque : ndarray, shape (n,)
        Recorded side, N m or N.
    """

    given: Array
    returned: Array
    work: Mapping[str, Array]
    heat: tuple[str, ...]
    rms_torque: Array

    @property
    def heated(self) -> Array:
        """Heat of each joint, J, shape (n,)."""
        return np.asarray(sum((self.work[name] for name in self.heat), np.zeros_like(self.given)))


def drive(known: IdentifiedModel, motion: Motion) -> Drive:
    """Return torque and power of the drives along a motion."""
    return Drive(motion, known.torque_parts(motion), known.robot.row_scale)


def energy_of(drives: Sequence[Drive]) -> Energy:
    """Add up the energy of stretches of a motion.

    Parameters
    ----------
    drives : sequence of Drive, at least one
    """
    names = list(drives[0].parts)
    powers = [{name: each.power_of(each.parts[name]) for name in names} for each in drives]
    work = {
        name: np.sum([each.work(power[name]) for each, power in zip(drives, powers, strict=True)], axis=0)
        for name in names
    }
    together = {name: np.concatenate([power[name] for power in powers], axis=1) for name in names}
    heat = tuple(name for name in names if np.any(work[name] != 0.0) and _of_one_sign(together[name]))
    squares = np.sum([np.sum(each.torque**2, axis=1) for each in drives], axis=0)
    return Energy(
        given=np.sum([each.work(np.maximum(each.power, 0.0)) for each in drives], axis=0),
        returned=np.sum([each.work(np.maximum(-each.power, 0.0)) for each in drives], axis=0),
        work=work,
        heat=heat,
        rms_torque=np.sqrt(squares / sum(each.motion.samples for each in drives)),
    )


def _of_one_sign(power: Array) -> bool:
    """Whether the power on every joint is never negative, or never positive."""
    small = ROUNDING * np.max(np.abs(power), axis=1)
    return bool(np.all((np.min(power, axis=1) >= -small) | (np.max(power, axis=1) <= small)))
