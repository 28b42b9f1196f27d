"""Lines in the residual's spectra, in motor angle and in time, as candidates with the right order or frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates import Candidate
from scara_ident.effects import Effect, Scene, SpectralLine
from scara_ident.effects.spectra import (
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

Array = NDArray[np.float64]

# Orders looked at, per motor turn, and points of the spectra per width of a line.
HIGHEST_ORDER = 13.0
LOWEST_ORDER = 0.4
POINTS_PER_WIDTH = 3.0
# The strongest line is taken; beside it the lesser ones are its sidelobes.
SIGNIFICANCE = 1e-3
# Periods in a recording below which a line in time is not told from motion.
LEAST_PERIODS = 6.0


def line_candidates(scene: Scene, residuals: Residuals, catalogue: Sequence[Effect]) -> list[Candidate]:
    """Return periodic effects at the strongest line of each joint's residual, in motor angle and in time.

    Parameters
    ----------
    scene : Scene
    residuals : Residuals
        Of the model with the effects found so far.
    catalogue : sequence of Effect
        Only families that are in it are offered.
    """
    seeded = [effect for effect in catalogue if effect.seeded_by is not None]
    if not seeded:
        return []
    found: list[Candidate] = []
    for j, reduction in enumerate(scene.robot.reduction):
        pieces, turns, rates = [], [], []
        for part, banded in zip(residuals.data.stretches, residuals.banded, strict=True):
            if part.samples <= 4 * part.trim:
                continue
            inside = slice(part.trim, part.samples - part.trim)
            pieces.append(np.where(part.rest[j], 0.0, banded[j])[inside])
            turns.append((reduction * part.motion.q[j])[inside])
            rates.append(part.rate)
        if not any(np.any(piece) for piece in pieces):
            continue
        rate, band = rates[0], residuals.data.bands[j]
        white = whitened(pieces, rate, highest=band)
        order = _strongest_order(white, turns)
        frequency = _strongest_frequency(white, rate, band or 0.4 * rate)
        strongest = [] if order is None else [SpectralLine("order", order)]
        strongest += [] if frequency is None else [SpectralLine("frequency", frequency)]
        found += [
            Candidate(effect, member)
            for line in strongest
            for effect in seeded
            for member in effect.seeds(scene, j, line)
        ]
    return found


def _strongest_order(residuals: Sequence[Array], turns: Sequence[Array]) -> float | None:
    angle = np.concatenate(turns)
    width = order_width(angle)
    if width > 0.3 * LOWEST_ORDER:
        return None
    orders = np.arange(LOWEST_ORDER, HIGHEST_ORDER, width / POINTS_PER_WIDTH)
    power = order_spectrum(np.concatenate(residuals), angle, orders)
    return _strongest(lines(orders, power, width, significance=SIGNIFICANCE))


def _strongest_frequency(residuals: Sequence[Array], rate: float, highest: float) -> float | None:
    width = frequency_width(residuals, rate)
    lowest = LEAST_PERIODS * 0.5 * width
    if highest < 3.0 * lowest:
        return None
    frequencies = np.arange(lowest, highest, width / POINTS_PER_WIDTH)
    power = frequency_spectrum(residuals, rate, frequencies)
    return _strongest(
        lines(
            frequencies,
            power,
            width,
            degrees=2 * len(residuals),
            neighbours=NEIGHBOURS_IN_TIME,
            significance=SIGNIFICANCE,
        )
    )


def _strongest(found: Sequence[Line]) -> float | None:
    best = max(found, key=lambda line: line.power / line.floor, default=None)
    return None if best is None else float(best.position)
