"""The size of a design: lengths of its trajectories, their harmonics, and the samples needed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.errors import UsageError

# Samples of a trajectory in the criterion: those of Indri et al. 2002.
SAMPLES = 2500
# Highest frequency of a motion by default, Hz: controllers still follow it and arms do not yet swing.
HIGHEST_FREQUENCY = 1.6
# Coefficients that a search handles quickly, and at all: its time grows with their cube.
MANY_COEFFICIENTS, MAX_COEFFICIENTS = 160, 600
# Samples per period of the highest harmonic that the criterion needs.
MIN_PER_PERIOD = 4
# A shorter motion has at least so many harmonics.
MIN_HARMONICS = 5
# They are told apart by a letter.
MAX_TRAJECTORIES = 26


def default_harmonics(duration: float, joints: int, trajectories: int = 1) -> int:
    """Return how many harmonics a motion has by default: up to 1.6 Hz, fewer where there are many joints or motions."""
    most = MANY_COEFFICIENTS // (2 * joints * trajectories)
    return max(5, min(round(HIGHEST_FREQUENCY * duration), most))


def durations_of(duration: float | Sequence[float], trajectories: int = 1) -> tuple[float, ...]:
    """Return the length of every trajectory, s.

    Parameters
    ----------
    duration : float or sequence of float
        One for all, or one for each.
    trajectories : int
        How many; several durations say that themselves.

    Raises
    ------
    UsageError
        If they do not agree, or are no positive numbers.
    """
    given = tuple(np.atleast_1d(np.asarray(duration, dtype=float)).tolist())
    for each in given:
        if not 0.0 < each < np.inf:
            raise UsageError(f"duration {each:g} s: expected a positive number of seconds")
    wanted = trajectories if len(given) == 1 else min(trajectories, 1) * len(given)
    if not 1 <= wanted <= MAX_TRAJECTORIES:
        raise UsageError(f"trajectories {wanted}: expected at least 1 and at most {MAX_TRAJECTORIES}")
    if len(given) == 1:
        return given * trajectories
    if not given or trajectories not in (1, len(given)):
        raise UsageError(f"{len(given)} durations for {trajectories} trajectories: give one for all, or one for each")
    return given


def harmonics_of(harmonics: int, share: float) -> int:
    """Return how many a motion of a share of the longest has: those up to the same frequency, and as many as rest needs."""
    return max(min(harmonics, MIN_HARMONICS), round(harmonics * share))


def check_size(chosen: int | Sequence[int], joints: int, trajectories: int, samples: int) -> None:
    """Refuse a design that a search cannot handle, or whose samples cannot tell its harmonics.

    Parameters
    ----------
    chosen : int or sequence of int
        How many harmonics, or which.

    Raises
    ------
    UsageError
        In one line.
    """
    most = max(5, MAX_COEFFICIENTS // (2 * joints * trajectories))
    harmonics, highest = (chosen, chosen) if isinstance(chosen, int) else (len(chosen), max(chosen, default=0))
    if harmonics > most:
        few = "" if trajectories == 1 else ", or fewer trajectories"
        raise UsageError(
            f"harmonics {harmonics}: more than a search over {joints} joints can handle; use at most {most}{few}"
        )
    if MIN_PER_PERIOD * highest > samples:
        raise UsageError(
            f"harmonic {highest}: {samples} samples cannot resolve so fast a motion; use at most "
            f"{samples // MIN_PER_PERIOD}, or more samples"
        )
