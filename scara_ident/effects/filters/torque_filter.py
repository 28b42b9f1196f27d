"""A filter of the efforts: the part that is left after its delay was corrected."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.filters.filter_rest import FilterRest
from scara_ident.effects.following import EstimateSlopes, predicted_slopes
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Signals


@dataclass(frozen=True)
class TorqueFilter(FilterRest):
    """Efforts of all joints after one low-pass filter, in addition to its delay.

    With the transfer function H of the filter and its delay T, which `TimeDelay` corrects, ``(exp(s T) H(s) - 1) u`` is left of
    the torque u. The columns are this rest for two filters with the same delay: a low-pass of first order and a Butterworth
    filter of second order. To third order in s any filter is a combination of both, see `FilterRest`. A pure delay has no part
    of either.
    """

    name = "torque_filter"
    summary = "effort that is recorded after a low-pass filter"
    experiment = "log the effort without a filter, or look up the corner frequency of its filter"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the rest of the predicted torque for each law."""
        return list(self.rest(signals.predicted, signals.motion.rate))

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> Array | None:
        """Return the same for the torque of effects in the model, because the whole recorded effort is filtered."""
        return np.moveaxis(self.rest(torque, signals.motion.rate), 0, 1)

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return the same for each column of the base model."""
        found = {joint: predicted_slopes(signals, joint) for joint in self.rows(signals.scene, member)}
        return {
            joint: (places, np.tensordot(value, self.rest(rows, signals.motion.rate), axes=1))
            for joint, (places, rows) in found.items()
        }
