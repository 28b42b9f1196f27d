"""The Box-Cox power of a parameter in which its uncertainty is symmetric.

Of a gear too stiff to be seen swinging the torque tells the compliance, of which the stiffness is the power -1: where the compliance
may be all but nothing, the stiffness has no upper end. A power of 1 is the parameter itself, 0 its logarithm, as of a distance that
is known to a factor; a parameter that is partly of one and partly of another kind has one between (Box and Cox 1964).
"""

from __future__ import annotations

import numpy as np

# The span of an interval, 95 %.
INTERVAL_STDS = 2.0
# An interval is reported where an end of it is so many standard deviations from that of the value ± these: less is lost in the digit
# that a standard deviation is written with.
NOTICEABLE_STDS = 0.5
# An end that is a larger factor from the value says nothing, but for the lower one of what is symmetric in its reciprocal: that is how
# large this may be.
MAX_INTERVAL_FACTOR = 100.0
# Logarithm that no factor exceeds: more is infinite.
LARGEST_LOG = 700.0


def changed(value: float, way: float, power: float) -> float:
    """Return the value so far from one, in that power, in units of the parameter there.

    None, or infinite, where the power has changed its sign before.
    """
    share = way / value
    if power != 0.0:
        if 1.0 + power * share <= 0.0:
            return np.inf if power < 0.0 else 0.0
        share = float(np.log1p(power * share)) / power
    return value * float(np.exp(min(share, LARGEST_LOG)))


def interval(value: float, std: float, power: float) -> tuple[float, float] | None:
    """Return the interval of 95 % of a parameter, an open end infinite; None where value and standard deviation tell it.

    Parameters
    ----------
    std : float
        Of the parameter at its value, to first order.
    """
    if power == 1.0 or not (0.0 < std < np.inf and 0.0 < value < np.inf):
        return None
    reach = INTERVAL_STDS * std
    low, high = (changed(value, way, power) for way in (-reach, reach))
    if max(abs(low - (value - reach)), abs(high - (value + reach))) < NOTICEABLE_STDS * std:
        return None
    bounded = power < 0.0 or low > value / MAX_INTERVAL_FACTOR
    return (low if bounded else -np.inf), (high if high < value * MAX_INTERVAL_FACTOR else np.inf)
