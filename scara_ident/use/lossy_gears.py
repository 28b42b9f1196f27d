"""Transmission losses of an external torque: what gears pass on to their drives, sample by sample."""

from __future__ import annotations

import math

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm, Signals
from scara_ident.model.prediction import states
from scara_ident.model.terms import Term
from scara_ident.robot.robot import Robot


def is_lossy(term: Term, value: Array) -> bool:
    """Whether a term of a model with these parameters is the loss of a gear."""
    return isinstance(term, EffectTerm) and term.effect.passes_on(term.member, value, 1.0) is not None


class LossyGears:
    """Turns the torque of drives into that on links, recorded side.

    A gear loses a share of all that it transmits, of a contact's torque too. So what it transmits is computed from the motor's side,
    from which the law of the loss is inverted: ``load = s (u - u_f - dp_r/dt)`` with the recorded torque u, its friction u_f, the
    momentum p_r of the rotor, and s the share that the gear passes on, below 1 where it drives and above 1 where it is driven
    (Hamon, Gautier, Garrec 2011). Which of both it does takes the acceleration, and that through a low-pass will do: where
    it is wrong the torque is small.

    Parameters
    ----------
    robot : Robot
    gears : list of (EffectTerm, ndarray)
        With the parameters of each.
    cut_off : float
        Of that low-pass, Hz.
    """

    def __init__(self, robot: Robot, gears: list[tuple[EffectTerm, Array]], cut_off: float) -> None:
        self._gears = [(term.in_state, value, term.member.place) for term, value in gears]
        self._gain = 2.0 * np.pi * cut_off
        self._direction = robot.drive_sign
        self._rotor = np.zeros(robot.n)
        for term, _, joint in self._gears:
            self._rotor[joint] = robot.row_scale[joint] * term.scene.armature(joint)
        self.reset()

    def reset(self) -> None:
        """Forget all before."""
        self._rate = np.zeros(len(self._rotor))
        self._before: tuple[Array, Array] | None = None

    def update(self, drive: Array, q: Array, v: Array, along: Array, step: float) -> tuple[Array, Array]:
        """Take one sample.

        Parameters
        ----------
        drive : ndarray, shape (n,)
            Recorded torque without friction and what else acts beside the bodies, N m or N.
        q, v : ndarray, shape (n,)
            Position and velocity of the joints, rad or m, rad/s or m/s.
        along : ndarray, shape (n,)
            Direction of it, -1 to 1, in between where the joint may stand still.
        step : float
            s since the sample before.

        Returns
        -------
        tuple of ndarray, shape (n,)
            The same as it is on the links, and the mean over the step of ``(1 - s) dp_r/dt``, which is no change of the links' momentum.
        """
        momentum, share = self._rotor * v, np.ones(len(drive))
        rate = np.zeros(len(drive))
        if self._before is not None:
            rate = (momentum - self._before[0]) / step
            self._rate = self._rate - math.expm1(-self._gain * step) * (rate - self._rate)
        held = np.zeros(len(drive))
        for term, value, joint in self._gears:
            if term.scene.link_torques:
                held[joint] = Signals(term.scene, states(q[:, None], v[:, None], np.zeros((len(q), 1)))).on_links[
                    joint, 0
                ]
            load = float(drive[joint] + held[joint] - self._rate[joint])
            driving = math.copysign(float(along[joint]), load * along[joint] * self._direction[joint])
            share[joint] = term.effect.passes_on(term.member, value, driving)
        lost = np.zeros(len(drive)) if self._before is None else (1.0 - 0.5 * (share + self._before[1])) * rate
        self._before = momentum, share
        return share * (drive + held) - held, lost
