"""The band in which motion explains torque, chosen from the data joint by joint.

Differentiated twice, the noise of a position grows with the square of frequency, so above some frequency the
regressor is noise. Where that is, the torque tells: with parameters fitted at low frequency, the torque that a
hardly filtered motion predicts is compared with the recorded one, frequency by frequency. Where the prediction
leaves more than half of the torque's power, motion and torque no longer speak of the same thing, be it for noise
in the position or in the torque, and the band ends.

The first fit is in a narrow band, where noise has grown least, and the band is widened as far as that fit explains. What
a fit in the wider band says then brackets it from both sides, so that the search ends and cannot swing. A band of B Hz
needs few samples a second, so it is chosen on recordings of a low rate, and of higher ones only where the band asks for
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.explained_power import FIRST_BAND, Explained, Spectra, bin_edges, sample, thinned_to
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import END_PERIODS, PreparedData
from scara_ident.threads import side_by_side, threads_for

# Smallest number of independent rows per parameter: what noise does to the estimate then adds a fifth to the noise variance of
# a prediction, p / N of it (Seber and Lee, Linear Regression Analysis, 2003, section 12.2).
ROWS_PER_PARAMETER = 5.0
# A joint that hardly moves is not given more than so many times the band that all joints together need.
MAX_BAND_RATIO = 2.0
# Independent values a second of a signal low-passed at 1 Hz (Nyquist).
ROWS_PER_HERTZ = 2.0
# Highest band as a share of the sample rate.
HIGHEST_BAND = 0.2
# The lowest sample rate that is looked at lets the first band widen so much; so much higher is the next.
FIRST_WIDENING = 8.0
NEXT_RATE = 16.0
# Parameters fitted in a band show how well the motion explains the torque up to this many times that band.
NEAR_FIT = 4.0
# A band above this share of the highest that a sample rate allows asks for the next.
NEAR_HIGHEST = 0.5


@dataclass(frozen=True)
class BandChoice:
    """Bands and how they came about.

    Attributes
    ----------
    bands : tuple of float
        Cut-off per joint, Hz.
    explained : tuple of float
        Share of the torque's power within the band that the fit explains, per joint.
    notes : tuple of str
        Remarks for the user, such as a joint whose torque the motion does not explain.
    """

    bands: tuple[float, ...]
    explained: tuple[float, ...]
    notes: tuple[str, ...]


def choose_bands(model: TorqueModel, data: PreparedData) -> BandChoice:
    """Choose the low-pass band of every joint.

    Parameters
    ----------
    model : TorqueModel
    data : PreparedData
        With effort; in any bands. The first repetition of each trajectory is looked at first.
    """
    _ = data.labels  # from the recordings as they are, before they are thinned
    edges = bin_edges([part.stretch for part in data.stretches])
    highest = HIGHEST_BAND * min(part.rate for part in data.stretches)
    slow_rate = FIRST_BAND * FIRST_WIDENING / HIGHEST_BAND
    slow = thinned_to(data.at((FIRST_BAND,) * len(data.bands)), slow_rate)
    moving = _moving(slow)
    floor = np.minimum(narrowest_bands(model, len(data.stretches), moving), highest)
    bands = np.minimum(np.maximum(floor, FIRST_BAND), highest)
    rate = float(np.max(bands)) * FIRST_WIDENING / HIGHEST_BAND
    fit = None
    while True:
        # In the bands of the first fit if none begins wider, so that rest is not computed again.
        level = sample(slow if rate == slow_rate else thinned_to(data, rate))
        allowed = HIGHEST_BAND * min(part.rate for part in level.stretches)
        with threads_for(max(part.samples for part in level.stretches)):
            # What fewer samples show is not taken back: of more, fewer recordings are looked at, behind a filter so wide that
            # noise turns the sign of friction.
            least = floor if fit is None else np.maximum(floor, bands)
            bands, fit = _widened(Spectra(model, level, edges), bands, least, allowed, fit)
        if allowed >= highest or np.max(bands) < NEAR_HIGHEST * allowed:
            return _choice(model, bands, fit, edges, floor, moving)
        rate *= NEXT_RATE


def _widened(
    spectra: Spectra, bands: Array, floor: Array, highest: float, known: Explained | None
) -> tuple[Array, Explained]:
    """Widen bands as far as a fit in them explains the torque, until they stay, and return them with the last fit.

    Each fit leaves a joint's band between the widest that explained beyond itself and the narrowest that did not, which
    is not tried again: the bracket shrinks by at least a bin in each round, so the search ends.
    """
    lower, upper = floor.copy(), np.full(len(bands), np.inf)
    bands = np.clip(bands, floor, highest)
    if known is None:
        bands, fit = _risen(spectra, bands, highest)
    else:
        fit = spectra.judged(known.bands, known.value)
    while True:
        # If a band contains so much noise that nothing is explained, a narrower one may explain something.
        wanted = np.where(fit.explains > 0.0, np.minimum(fit.explains, highest), 0.5 * bands)
        wider = wanted >= bands
        lower, upper = np.where(wider, bands, lower), np.where(wider, upper, bands)
        bands = np.where(wider & (wanted >= upper), bands, np.maximum(wanted, lower))
        if np.all((bands >= fit.bands) & (bands <= NEAR_FIT * fit.bands)):
            return bands, fit
        fit = spectra.fit(bands)


def _risen(spectra: Spectra, bands: Array, highest: float) -> tuple[Array, Explained]:
    """Return the bands to begin with, and the fit in them: wider ones of joints that these leave unexplained and wider ones explain.

    A fit that does not explain the band that it was made in is behind too much noise, or in too narrow a band: of an even motion
    with sharp turns a filter takes away what tells inertia, and what is fast in two signals is part of the slow torque that their product
    makes. Wider bands show which.
    """
    tried = bands
    while True:
        fit = spectra.fit(tried)
        short = fit.explains < tried
        bands = np.where(short, bands, tried)
        rising = short & (tried < highest)
        if not np.any(rising):
            return bands, fit if np.array_equal(tried, bands) else spectra.fit(bands)
        tried = np.where(rising, np.minimum(2.0 * tried, highest), tried)


def _choice(model: TorqueModel, bands: Array, fit: Explained, edges: Array, floor: Array, moving: Array) -> BandChoice:
    """Return the choice with its remarks for the user."""
    place = np.clip(np.searchsorted(edges, bands * (1.0 - 1e-9)) - 1, 0, fit.shares.shape[1] - 1)
    some = fit.explains > 0.0
    explained = np.where(some, fit.shares[np.arange(len(place)), place], 0.0)
    notes, narrow = [], list[int]()
    for j, (joint, need) in enumerate(zip(model.robot.joints, needed_rows(model), strict=True)):
        band, rows = bands[j], ROWS_PER_HERTZ * bands[j] * moving[j]
        if not some[j]:
            notes.append(
                f"{joint}: at every frequency its motion explains less than half of its torque; the band stays at {band:.3g} Hz"
            )
        elif fit.explains[j] < band and band <= floor[j]:
            narrow.append(j)
        if moving[j] > 0.0 and rows < need:
            notes.append(
                f"{joint}: moves for {moving[j]:.2g} s in all, which is too short to determine its parameters; record it in motion"
            )
    if narrow:
        notes.insert(0, _needs_longer(model, narrow, fit.explains, bands))
    return BandChoice(tuple(bands.tolist()), tuple(explained.tolist()), tuple(notes))


def _needs_longer(model: TorqueModel, joints: Sequence[int], explains: Array, bands: Array) -> str:
    """Say in one line that these joints' bands are as wide as the number of rows asks for, not as the motion allows."""
    names, one = ", ".join(model.robot.joints[j] for j in joints), len(joints) == 1
    up_to, least = (", ".join(f"{each[j]:.{digits}g}" for j in joints) for each, digits in ((explains, 2), (bands, 3)))
    return (
        f"{names}: {'its' if one else 'their'} motion explains {'its' if one else 'their'} torque up to {up_to} Hz, but "
        f"{'a band' if one else 'bands'} below {least} Hz would leave fewer than {ROWS_PER_PARAMETER:g} independent rows per "
        "parameter; record longer"
    )


def needed_rows(model: TorqueModel) -> Array:
    """Return the number of parameters that the rows of each joint must determine, shape (n,).

    A parameter that acts on several joints is shared equally by them. With at least so many rows on every joint, no
    set of joints has fewer rows than there are parameters that act on no other joint (Hall's condition), and all
    together have as many as the model has parameters.
    """
    pattern = model.pattern
    share = 1.0 / np.maximum(np.sum(pattern, axis=0), 1)
    return np.asarray(pattern @ share, dtype=float)


def narrowest_bands(model: TorqueModel, stretches: int, moving: Array) -> Array:
    """Return the bands below which there are too few independent rows for the parameters, Hz, shape (n,).

    A signal low-passed at B Hz has 2 B independent values a second, less those of a period at both ends of every stretch.

    Parameters
    ----------
    model : TorqueModel
    stretches : int
        Their number.
    moving : ndarray, shape (n,)
        Time in which each joint moves, s.
    """
    if not np.any(moving > 0.0):
        return np.zeros(len(moving))
    need = ROWS_PER_PARAMETER * needed_rows(model) / ROWS_PER_HERTZ + 2.0 * END_PERIODS * stretches
    together = float(np.sum(need) / np.sum(moving))
    alone = np.divide(need, moving, out=np.full(len(need), np.inf), where=moving > 0.0)
    return np.asarray(np.clip(alone, together, MAX_BAND_RATIO * together))


def _moving(slow: PreparedData) -> Array:
    """Return the time in which each joint moves, s, shape (n,)."""
    with threads_for(max(part.samples for part in slow.stretches)):
        times = side_by_side(lambda part: np.count_nonzero(~part.rest, axis=1) / part.rate, slow.stretches)
    return np.asarray(np.sum(times, axis=0))
