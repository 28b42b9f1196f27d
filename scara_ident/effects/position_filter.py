"""What remains of a filter of the positions once its delay was corrected."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.following import EstimateSlopes, predicted_slopes
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.motion.low_pass import differentiate

# Of positions that are late by T seconds, motion up to this over T, Hz, is known where a filter makes them late: a mean over 2 T or a lag
# of first order leaves 86 or 73 % of it, and the derivatives of `PositionFilter` all of the torque but 0.2 or 2 %. Of a fifth over T they leave 1
# and 10 %, for which gears of single joints may stand. If efforts are late by T, a filter hides effects of the arm in the same way.
FILTERED = 0.15


class PositionFilter(Effect):
    """Positions of all joints behind one filter of their own, beside the delay that it is to first order.

    It is no part of an arm and in no catalogue: an elastic gear of a joint, whose link lags by its load, does to the torque
    what a filter does by all loads. A filter that keeps what rests is ``exp(-s T) (1 + c s^2 + d s^3 + ...)``, and
    the torque, moved by T, is that of ``(1 - c s^2 - d s^3 - ...) q``: ``-c`` times the second derivative of the bodies' torque and so
    on, as far as inertias stay what they are meanwhile. A mean over L has ``c = L^2/24``, a lag of first order
    ``T^2/2`` and ``d = -T^3/3``, a Butterworth filter of second order no c. The first derivative is what the delay is off by.
    Links behind elastic gears follow from the same positions: what they change of the torque is filtered too.
    """

    name = "position_filter"
    summary = "a filter of all positions before they were recorded"
    coefficients = tuple(
        Coefficient(f"order_{k}", unit, f"derivative {k} of the bodies' torque")
        for k, unit in enumerate(("s", "s^2", "s^3", "s^4"), start=1)
    )
    all_joints = True
    follows_estimate = True
    beside_together = True
    smooth = True
    not_simulated = "it is not a property of the arm"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return that of all joints."""
        return (Member(None),)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the first four derivatives of the torque of bodies, links that lag among them."""
        return list(_derivatives(signals, signals.rigid + signals.of_together))

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return those of the bodies' torque: how links lag by other bodies is small beside it."""
        place, found = signals.scene.model.place(signals.scene.model.rigid_body), {}
        for joint in self.rows(signals.scene, member):
            places, rows = predicted_slopes(signals, joint)
            own = (places >= place.start) & (places < place.stop)
            found[joint] = places[own], np.tensordot(value, _derivatives(signals, rows[own]), axes=1)
        return found


def _derivatives(signals: Signals, torque: Array) -> Array:
    """Return the first four derivatives of torques (k, N), shape (4, k, N)."""
    rate, cut = signals.motion.rate, signals.derivative_cut
    _, first, second = differentiate(torque, rate, cut)
    return np.stack([first, second, *differentiate(second, rate, cut)[1:]])
