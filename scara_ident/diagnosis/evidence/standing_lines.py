"""Standing lines in the residual's spectrum: what is periodic in time is no noise, whatever its phase in each recording.

A torque that runs on its own, as a fan's or a floor's, has another phase in every recording: it repeats in none, and what
repeats of a residual says nothing of it. One above the band is in no fit at all.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.candidates.lines import lines_in_time
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.selection.tentative import TentativeEffect
from scara_ident.effects import Effect, SpectralLine
from scara_ident.effects.spectra import HIGHEST_FREQUENCY_SHARE, frequency_spectrum, whitened
from scara_ident.estimation.residuals import Residuals
from scara_ident.threads import side_by_side

# Rates that differ by more than this share are not looked at together.
SAME_RATE = 0.01
# Between two frequencies of a recording of its own length a line has this share of its power at the nearer one.
MIN_LINE_SHARE = 0.7


@dataclass(frozen=True)
class StandingLine:
    """The line of a joint's residual that holds most of it.

    Attributes
    ----------
    frequency : float
        Hz.
    amplitude : float
        N m or N, as recorded: nothing is filtered.
    share : float
        Its mean square over that of all that is left within the band.
    within : bool
        Whether it lies within the band.
    p_value : float
        That noise has such a line.
    """

    joint: int
    frequency: float
    amplitude: float
    share: float
    within: bool
    p_value: float

    def sentence(self, unit: str, band: float | None) -> str:
        """Say what it is, and what to do."""
        what = f"a spectral line of {self.amplitude:.3g} {unit} at {self.frequency:.4g} Hz, which is not noise,"
        if self.within or band is None:
            return (
                f"{min(1.0, self.share):.0%} of the residual's power is {what} and has another phase in each recording"
            )
        return f"above the band of {band:.3g} Hz there is {what} and is larger than all that is left within the band: give a wider band"


def standing_lines(residuals: Residuals, criteria: SelectionCriteria = CRITERIA) -> tuple[StandingLine | None, ...]:
    """Return for each joint the line that says that what is left is no noise, None where there is none.

    Within the band that is one that holds more of the power than noise may that is not white, above it one that is larger
    than all that is left within. There positions are noise, which a prediction carries on, and which motions that are repeated
    repeat as encoders round them: a line has to be in the torque itself.

    Parameters
    ----------
    residuals : Residuals
        Of the model with the effects found.
    """
    data = residuals.data

    def of_joint(j: int) -> StandingLine | None:
        pieces, recorded, squares, fade = [], [], 0.0, []
        for part, predicted, banded in zip(data.stretches, residuals.predicted, residuals.banded, strict=True):
            if not part.usable or part.samples <= 4 * part.trim or not np.any(part.used[j]):
                continue
            # A frequency of one rate is another one of others.
            if abs(part.rate - data.stretches[0].rate) > SAME_RATE * part.rate:
                continue
            inside = slice(part.trim, part.samples - part.trim)
            fade.append(part.fade[j][inside])
            recorded.append(fade[-1] * part.torque[j][inside])
            pieces.append(recorded[-1] - fade[-1] * predicted[j][inside])
            squares += float(np.sum(banded[j][inside] ** 2))
        if not pieces or squares == 0.0:
            return None
        moving = np.concatenate(fade)
        within, rate, band = squares / len(moving), data.stretches[0].rate, data.bands[j]
        if not _may_have(pieces, rate, band, within, criteria):
            return None
        line = _largest(j, pieces, recorded, rate, band, within, criteria)
        # Faded out at rest a line is as much smaller.
        return None if line is None else replace(line, amplitude=line.amplitude / float(np.mean(moving)))

    return tuple(side_by_side(of_joint, range(len(data.bands))))


def _may_have(
    pieces: Sequence[Array], rate: float, band: float | None, within: float, criteria: SelectionCriteria
) -> bool:
    """Whether the largest powers of the recordings reach what is asked of a line; of noise alone they are far from it."""
    largest, samples = np.zeros(2), sum(map(len, pieces))
    for piece in pieces:
        count = len(piece)
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)
        shape = piece - np.average(piece, weights=window)
        power = 0.5 * (np.abs(np.fft.rfft(window * shape)) * 2.0 / np.sum(window)) ** 2
        edge = len(power) if band is None else int(np.searchsorted(np.fft.rfftfreq(count, 1.0 / rate), band, "right"))
        largest += count * np.array([np.max(power[:edge], initial=0.0), np.max(power[edge:], initial=0.0)])
    return bool(np.any(largest > MIN_LINE_SHARE * samples * within * np.array([criteria.min_colour, 1.0])))


def _largest(
    joint: int,
    pieces: Sequence[Array],
    recorded: Sequence[Array],
    rate: float,
    band: float | None,
    within: float,
    criteria: SelectionCriteria,
) -> StandingLine | None:
    """Return the line with the largest share beyond what is allowed."""
    highest = HIGHEST_FREQUENCY_SHARE * rate
    (white,) = whitened(pieces, rate, highest)
    found = lines_in_time(white, rate, highest, criteria)
    if not found:
        return None
    frequencies = np.array([line.position for line in found])
    power = frequency_spectrum(pieces, rate, frequencies)
    inside = np.full(len(found), True) if band is None else frequencies <= band
    power = np.where(inside, power, np.minimum(power, frequency_spectrum(recorded, rate, frequencies)))
    share = power / within
    beyond = np.where(inside, share / criteria.min_colour, share)
    place = int(np.argmax(beyond))
    if beyond[place] <= 1.0:
        return None
    amplitude = float(np.sqrt(2.0 * power[place]))
    return StandingLine(
        joint, float(frequencies[place]), amplitude, float(share[place]), bool(inside[place]), found[place].p_value
    )


def without_lines(
    shown: Sequence[Evidence], lines: Sequence[StandingLine | None], found: Search
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise on the joints in which a line stays."""
    robot, bands = found.scene.robot, found.bands
    return tuple(
        item
        if line is None or not item.shown
        else replace(item, shown=False, by="", why=line.sentence(robot.torque_unit(line.joint), bands[line.joint]))
        for item, line in zip(shown, lines, strict=True)
    )


def tentative_lines(
    lines: Sequence[StandingLine | None],
    found: Search,
    families: Sequence[Effect],
    found_lines: Collection[tuple[str, str | None]],
) -> tuple[TentativeEffect, ...]:
    """Return what may make the lines that stay, of the effects that are looked for by frequency.

    Parameters
    ----------
    found_lines : collection of (str, str or None)
        Name and joint of the effects in the model and of those worth a look, which are not listed again.
    """
    scene, result = found.scene, []
    for line in filter(None, lines):
        why = line.sentence(scene.robot.torque_unit(line.joint), found.bands[line.joint])
        gain = min(1.0, line.share) if line.within else 0.0
        for effect in families:
            if effect.seeded_by != "frequency":
                continue
            for member in effect.seeds(scene, line.joint, SpectralLine("frequency", line.frequency)):
                joint = Candidate(effect, member).joint(scene)
                if (effect.name, joint) not in found_lines:
                    words = effect.description(scene, member)
                    result.append(
                        TentativeEffect(effect.name, joint, words, why, effect.experiment, gain, line.p_value)
                    )
    return tuple(result)
