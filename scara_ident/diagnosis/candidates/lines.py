"""Lines in the residual's spectra, in motor angle and in time, as candidates with the right order or frequency."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.effects import Effect, Scene, SpectralLine
from scara_ident.effects.spectra import (
    HIGHEST_FREQUENCY_SHARE,
    NEIGHBOURS_IN_TIME,
    Line,
    frequency_spectrum,
    frequency_width,
    lines,
    order_spectrum,
    order_width,
    whitened,
)
from scara_ident.estimation.residuals import Residuals
from scara_ident.threads import side_by_side

# Points of the spectra per width of a line, so that its peak is hardly missed between two.
POINTS_PER_WIDTH = 3.0
# Line width over the lowest order from which on its neighbours, that give the noise floor, reach down to order zero.
COARSEST_WIDTH = 0.3
# A line in time may be so many bands high: the low-pass leaves a 257th of it there, which noise may be smaller than.
ABOVE_BAND = 2.0
# Highest over lowest frequency below which the range holds too few neighbours for a noise floor.
NARROWEST_RANGE = 3.0


def line_candidates(
    scene: Scene, residuals: Residuals, catalogue: Sequence[Effect], criteria: SelectionCriteria = CRITERIA
) -> list[Candidate]:
    """Return periodic effects at the strongest line of each joint's residual, in motor angle and in time.

    Parameters
    ----------
    residuals : Residuals
        Of the model with the effects found so far.
    catalogue : sequence of Effect
        Only families that are in it are offered.
    """
    seeded = [effect for effect in catalogue if effect.seeded_by is not None]
    if not seeded:
        return []
    long = [
        (part, banded)
        for part, banded in zip(residuals.data.stretches, residuals.banded, strict=True)
        if part.samples > 4 * part.trim
    ]

    def of_joint(j: int) -> list[Candidate]:
        pieces, turns = [], []
        for part, banded in long:
            inside = slice(part.trim, part.samples - part.trim)
            pieces.append(np.where(part.rest[j], 0.0, banded[j])[inside])
            turns.append((scene.robot.reduction[j] * part.motion.q[j])[inside])
        if not any(np.any(piece) for piece in pieces):
            return []
        rate, band = long[0][0].rate, residuals.data.bands[j]
        highest = HIGHEST_FREQUENCY_SHARE * rate
        above_band = [min(ABOVE_BAND * band, highest)] if band is not None and band < highest else []
        white, *wider = whitened(pieces, rate, band, *above_band)
        order = _strongest_order(white, turns, criteria)
        strongest = [] if order is None else [SpectralLine("order", order)]
        within = _strongest_frequency(white, rate, (0.0, band or highest), criteria, band)
        strongest += [] if within is None else [SpectralLine("frequency", within)]
        for reach, wide in zip(above_band, wider, strict=True):
            above = _strongest_frequency(wide, rate, (band or 0.0, reach), criteria, reach)
            strongest += [] if above is None else [SpectralLine("frequency", above)]
        return [
            Candidate(effect, member)
            for line in strongest
            for effect in seeded
            for member in effect.seeds(scene, j, line)
        ]

    return list(chain.from_iterable(side_by_side(of_joint, range(scene.robot.n))))


def _strongest_order(residuals: Sequence[Array], turns: Sequence[Array], criteria: SelectionCriteria) -> float | None:
    angle = np.concatenate(turns)
    width = order_width(angle)
    if width > COARSEST_WIDTH * criteria.lowest_order:
        return None
    orders = np.arange(criteria.lowest_order, criteria.highest_order, width / POINTS_PER_WIDTH)
    power = order_spectrum(np.concatenate(residuals), angle, orders)
    return _strongest(lines(orders, power, width, significance=criteria.line_significance))


def _strongest_frequency(
    residuals: Sequence[Array],
    rate: float,
    reach: tuple[float, float],
    criteria: SelectionCriteria,
    cut: float | None,
) -> float | None:
    """Return the strongest line between two frequencies, Hz, of residuals that have nothing above a third one."""
    found = lines_in_time(residuals, rate, reach[1], criteria, cut)
    return _strongest([line for line in found if line.position >= reach[0]])


def lines_in_time(
    residuals: Sequence[Array], rate: float, highest: float, criteria: SelectionCriteria, cut: float | None = None
) -> list[Line]:
    """Return the lines of residuals up to a frequency, Hz, whatever their phase in each recording.

    Parameters
    ----------
    residuals : sequence of ndarray, each of shape (N_r,)
        See `whitened`.
    rate, highest : float
        Samples per second, and Hz.
    cut : float, optional
        Hz above which the residuals have nothing.
    """
    width = frequency_width(residuals, rate)
    lowest = criteria.min_line_periods * 0.5 * width
    if highest < NARROWEST_RANGE * lowest:
        return []
    frequencies = np.arange(lowest, highest, width / POINTS_PER_WIDTH)
    return lines(
        frequencies,
        frequency_spectrum(residuals, rate, frequencies, highest=cut),
        width,
        degrees=2 * len(residuals),
        neighbours=NEIGHBOURS_IN_TIME,
        significance=criteria.line_significance,
    )


def _strongest(found: Sequence[Line]) -> float | None:
    best = max(found, key=lambda line: line.power / line.floor, default=None)
    return None if best is None else float(best.position)
