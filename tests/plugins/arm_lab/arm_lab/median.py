"""The median over recordings of every parameter, which one bad recording does not spoil."""

from dataclasses import replace

import numpy as np

from scara_ident import ols


def median(observations):
    """Estimate from each recording alone, and take the median; the covariance is that of all together."""
    each = [ols(item).value for item in observations.each]
    return replace(ols(observations), method="median", value=np.median(each, axis=0))
