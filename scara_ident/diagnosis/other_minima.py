"""Fits of effects that act together, begun again elsewhere: one takes up what another does, and a fit may end in any minimum.

What such effects' parameters owe to the minimum, to the band, and to others of their kind that were not found, their standard
deviations are to hold: the noise of positions, which grows with frequency, may make a minimum of its own in a wide band, and what is
too small to be found is taken up by what was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates import Candidate, columns_at_hand
from scara_ident.diagnosis.effect_parameters import physical_parameters
from scara_ident.diagnosis.exchange import same
from scara_ident.diagnosis.linearised import linearise
from scara_ident.diagnosis.nonlinear_fit import LEAST_FALL, RISE, tune
from scara_ident.diagnosis.selection_step import SelectionStep
from scara_ident.effects import Parameter
from scara_ident.errors import RecordingError
from scara_ident.estimation.noise_bias import NEGLIGIBLE, noise_shares
from scara_ident.estimation.run_offsets import offsets_on

# A fit that leaves so many times as much is no rival, whatever rows will weigh in the end.
RIVAL = 2.0


def lowest(step: SelectionStep) -> SelectionStep:
    """Fit as `tune` does, and where several effects act together from elsewhere too; return the fit with the least error.

    Each of them in turn begins as `Effect.elsewhere` has it, the others where the first fit ended.
    """
    best = tune(step)
    if len(_together(best)) < 2:
        return best
    ends = _from_elsewhere(replace(best, minima=()))
    near = _near(best, ends)
    if near:
        other = tune(near[0])
        if linearise(other).error < (1.0 - RISE) * linearise(best).error:
            best, ends = other, [best, *(each for each in ends if each is not near[0])]
    most = RIVAL * linearise(best).error
    rivals = [each for each in ends if linearise(each).error < most]
    return replace(best, minima=tuple(_acting(each) for each in (best, *rivals)))


def as_good(step: SelectionStep) -> Iterator[SelectionStep]:
    """Give other fits of effects that act together, as good as that of a step by what the recordings say.

    They are other minima with no larger error than chance makes; the fit in the lower part of the band, where it is another one by
    more than chance; and fits with one more of their kind that may be there. The effects of the step come first in each.
    """
    places = _together(step)
    if not places:
        return
    if len(places) > 1:
        yield from (other for other in _near(step, _from_elsewhere(step)) if _alike(step, other, places))
        below = _below(step)
        if below is not None and _others(step, below, places):
            yield below
    for member in step.chosen[places[0]].effect.unfound(step.scene, step.chosen[places[0]].member):
        further = replace(step.chosen[places[0]], member=member)
        other = tune(replace(step, chosen=(*step.chosen, further)))
        if linearise(other).error < (1.0 - RISE) * linearise(step).error:
            yield other


def _together(step: SelectionStep) -> list[int]:
    return [place for place, item in enumerate(step.chosen) if item.effect.together]


def _acting(step: SelectionStep) -> tuple[Candidate, ...]:
    return tuple(step.chosen[place] for place in _together(step))


def _near(step: SelectionStep, fits: Sequence[SelectionStep]) -> list[SelectionStep]:
    """Return the coarse fits that may come down to the error of a step, the best first."""
    enough = (1.0 + LEAST_FALL) * linearise(step).error
    errors = [linearise(each).error for each in fits]
    return [fits[k] for k in np.argsort(errors) if errors[k] < enough]


def _from_elsewhere(step: SelectionStep) -> list[SelectionStep]:
    """Return coarse fits that began with one of several effects elsewhere, or where those of the same effects ended."""
    return [tune(begun, coarse=True) for begun in (_at_rivals(step) if _of_these(step) else _elsewhere(step))]


def _of_these(step: SelectionStep) -> bool:
    """Whether fits of the same effects began elsewhere before."""
    own, known = ([item.label(step.scene) for item in items] for items in (_acting(step), (step.minima or ((),))[0]))
    return own == known


def _at_rivals(step: SelectionStep) -> Iterator[SelectionStep]:
    for each in step.minima[1:]:
        chosen: tuple[Candidate, ...] = step.chosen
        for place, item in zip(_together(step), each, strict=True):
            chosen = _with(chosen, place, item)
        yield replace(step, chosen=chosen)


def _elsewhere(step: SelectionStep) -> Iterator[SelectionStep]:
    for place in _together(step):
        item = step.chosen[place]
        for member in item.effect.elsewhere(step.scene, item.member):
            yield replace(step, chosen=_with(step.chosen, place, replace(item, member=member)))


def _with(chosen: Sequence[Candidate], place: int, item: Candidate) -> tuple[Candidate, ...]:
    return (*chosen[:place], item, *chosen[place + 1 :])


def _alike(step: SelectionStep, other: SelectionStep, places: Sequence[int]) -> bool:
    """Whether another fit of the same effects leaves as much, by the last of those that act together."""
    mine, its = (each.without(places[-1]) for each in (step, other))
    judged = [beside.judge([each.chosen[places[-1]]])[0] for beside, each in ((mine, step), (its, other))]
    return same((mine, judged[0]), (its, judged[1]))


def _below(step: SelectionStep) -> SelectionStep | None:
    """Return the fit in the lower part of the band; None where recordings are too short for that or positions have no noise."""
    if max(noise_shares(step.observations.data), default=0.0) < NEGLIGIBLE:
        return None
    # Half-way to it, by octaves, as of a fast resonance little is in so low a part.
    share = float(np.sqrt(step.criteria.lower_band))
    bands = tuple(share * (band or step.scene.band) for band in step.observations.data.bands)
    try:
        columns = step.columns.at(bands)
    except RecordingError:
        return None
    scene = replace(step.scene, band=max(bands), columns=columns_at_hand(columns.observations))
    variation = offsets_on(columns.observations, step.offsets)
    return tune(replace(step, scene=scene, columns=columns, variation=variation))


def _others(step: SelectionStep, other: SelectionStep, places: Sequence[int]) -> bool:
    """Whether any parameter of effects that act together differs by more than chance from that of another fit."""
    here, there = (physical_parameters(each).effects for each in (step, other))
    return any(
        abs(there[place][name].value - one.value) > step.criteria.alike * np.hypot(one.std, there[place][name].std)
        for place in places
        for name, one in here[place].items()
    )


def widened(own: Mapping[str, Parameter], told: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return parameters for which what those of a fit as good differ by is one more standard deviation."""
    return {
        name: replace(one, std=float(np.hypot(one.std, told[name].value - one.value))) if name in told else one
        for name, one in own.items()
    }
