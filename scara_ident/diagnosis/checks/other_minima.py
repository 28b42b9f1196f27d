"""Other minima of effects that act together: fits started elsewhere, because one effect may absorb another.

What such effects' parameters owe to the minimum, to the band, and to others of their kind that were not found, their standard
deviations are to hold: the noise of positions, which grows with frequency, may make a minimum of its own in a wide band, and what is
too small to be found is taken up by what was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters, size_is_determined
from scara_ident.diagnosis.fitting.nonlinear_fit import MAX_RISE, MIN_DECREASE, tune
from scara_ident.diagnosis.fitting.part_of_recordings import on_all, on_part
from scara_ident.diagnosis.fitting.present_model import present_model
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Parameter
from scara_ident.errors import RecordingError
from scara_ident.estimation.noise_bias import OF_LAG, noisy
from scara_ident.estimation.run_offsets import offsets_on

# A fit that leaves so many times as much is no alternative, whatever rows will weigh in the end.
ALTERNATIVE = 2.0
# Fits whose nonlinear parameters differ by no larger share ended in the same minimum: so near do coarse ones come to it.
SAME_MINIMUM_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fit, and the squared error that it leaves."""

    step: SelectionStep
    error: float

    def near(self, other: _Fit) -> bool:
        """Whether it may come down to the error of another fit."""
        return self.error < (1.0 + MIN_DECREASE) * other.error


def lowest(step: SelectionStep) -> SelectionStep:
    """Fit as `tune` does, and where several effects act together from elsewhere too; return the fit with the least error.

    Each of them in turn begins as `Effect.elsewhere` has it, the others where the first fit ended.
    """
    first = tune(step)
    if len(_together(first)) < 2:
        return first
    best = _Fit(replace(first, minima=()), present_model(first).error)
    alternatives = _alternatives(best)
    if alternatives and alternatives[0].near(best):
        other = _fitted(alternatives[0].step)
        if other.error < (1.0 - MAX_RISE) * best.error:
            best, alternatives = (
                other,
                [each for each in (best, *alternatives[1:]) if each.error < ALTERNATIVE * other.error],
            )
    return replace(best.step, minima=tuple(_acting(each.step) for each in (best, *alternatives)))


def as_good(step: SelectionStep) -> Iterator[SelectionStep]:
    """Give other fits of effects that act together, as good as that of a step by what the recordings say.

    They are other minima with no larger error than chance makes; the fit in the lower part of the band, where it is another one by
    more than chance; and fits with one more of their kind that may be there. The effects of the step come first in each.
    """
    places = _together(step)
    if not places:
        return
    if len(places) > 1:
        own = _Fit(step, present_model(step).error)
        yield from (each.step for each in _alternatives(own) if each.near(own) and _alike(step, each.step, places))
        below = _below(step)
        if below is not None and _others(step, below, places):
            yield below
    for member in step.chosen[places[0]].effect.unfound(step.scene, step.chosen[places[0]].member):
        further = replace(step.chosen[places[0]], member=member)
        other = tune(replace(step, chosen=(*step.chosen, further)))
        if present_model(other).error < (1.0 - MAX_RISE) * present_model(step).error:
            yield other


def quieter(step: SelectionStep) -> SelectionStep | None:
    """Return the fit in the lower part of the band where effects that act together are to be estimated there.

    That is where the noise of positions moves the step's away from it, what lags has no such noise there, and every effect of the
    step is determined there; else None.
    """
    places = _together(step)
    below = _below(step) if places else None
    if below is None or noisy(below.observations.data, OF_LAG) or not _moved_by_noise(step, below, places):
        return None
    other = zip(below.chosen, physical_parameters(below).effects, strict=True)
    return (
        below
        if all(size_is_determined(item.effect, own, step.criteria.min_final_size) for item, own in other)
        else None
    )


def _together(step: SelectionStep) -> list[int]:
    return [place for place, item in enumerate(step.chosen) if item.effect.together]


def _acting(step: SelectionStep) -> tuple[Candidate, ...]:
    return tuple(step.chosen[place] for place in _together(step))


def _fitted(step: SelectionStep, *, coarse: bool = False) -> _Fit:
    found = tune(step, coarse=coarse)
    return _Fit(found, present_model(found).error)


def _alternatives(own: _Fit) -> list[_Fit]:
    """Return other coarse fits that leave not much more than one's own, the best first.

    They began with one of several effects elsewhere, or where those of the same effects ended.
    """
    step = own.step
    if _of_these(step):
        found = [_fitted(begun, coarse=True) for begun in _at_alternatives(step)]
    else:
        part = on_part(step)
        ends = [tune(begun, coarse=True) for begun in _elsewhere(part)]
        found = [_Fit(end, present_model(end).error) for end in (on_all(end, step) for end in ends)]
        if part is not step:
            found = [_fitted(each.step, coarse=True) for each in found if each.error < ALTERNATIVE * own.error]
    found = [each for each in found if each.error < ALTERNATIVE * own.error and not _same(each.step, step)]
    return sorted(found, key=lambda each: each.error)


def _same(one: SelectionStep, other: SelectionStep) -> bool:
    """Whether two fits of the same effects ended in the same minimum, as near as coarse fits come."""
    pairs = zip(_acting(one), _acting(other), strict=True)
    return all(
        np.allclose(mine.member.nonlinear, its.member.nonlinear, rtol=SAME_MINIMUM_SHARE, atol=0.0)
        for mine, its in pairs
    )


def _of_these(step: SelectionStep) -> bool:
    """Whether fits of the same effects began elsewhere before."""
    own, known = ([item.label(step.scene) for item in items] for items in (_acting(step), (step.minima or ((),))[0]))
    return own == known


def _at_alternatives(step: SelectionStep) -> Iterator[SelectionStep]:
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
    data = step.observations.data
    if not noisy(data, OF_LAG):
        return None
    # Half-way to it, by octaves, as of a fast resonance little is in so low a part; further where a resonance still makes more of
    # the noise than of the motion: with a damping that is too large for the gear it is fitted to both, and as much noise once
    # more then says nothing of that.
    share = float(np.sqrt(step.criteria.lower_band))
    lower = [tuple(share * (band or step.scene.band) for band in data.bands)]
    while noisy(data.at(lower[-1]), OF_LAG):
        lower.append(tuple(share * band for band in lower[-1]))
    columns = next(
        (found for found in (_columns_at(step, bands) for bands in reversed(lower)) if found is not None), None
    )
    if columns is None:
        return None
    band = max(band or step.scene.band for band in columns.observations.data.bands)
    scene = replace(step.scene, band=band, columns=columns_at_hand(columns.observations))
    variation = offsets_on(columns.observations, step.offsets)
    return tune(replace(step, scene=scene, columns=columns, variation=variation))


def _columns_at(step: SelectionStep, bands: tuple[float, ...]) -> CandidateColumns | None:
    """Return the columns in some bands; None where a recording is too short for them."""
    try:
        return step.columns.at(bands)
    except RecordingError:
        return None


def _others(step: SelectionStep, other: SelectionStep, places: Sequence[int]) -> bool:
    """Whether any parameter of effects that act together differs by more than chance from that of another fit."""
    here, there = (physical_parameters(each).effects for each in (step, other))
    return bool(_differing(here, there, places, step.criteria.alike))


def _moved_by_noise(step: SelectionStep, below: SelectionStep, places: Sequence[int]) -> bool:
    """Whether any of them differs by more than chance from that of a fit below the noise, which moves it away from there.

    With the noise twice it moves by as much again (Cook and Stefanski, JASA 89, 1994). Without that it is no noise that tells them
    apart: below a resonance little is seen of it, and what else a model lacks counts for more.
    """
    alike = step.criteria.alike
    here, there = (physical_parameters(each, of_noise=False).effects for each in (step, below))
    differing = _differing(here, there, places, alike)
    if not differing:
        return False
    again = physical_parameters(tune(step.noisier), of_noise=False).effects
    for place, name in differing:
        own, moved = here[place][name], again[place][name].value - here[place][name].value
        if abs(moved) > alike * own.std and moved * (own.value - there[place][name].value) > 0.0:
            return True
    return False


def _differing(
    here: Sequence[Mapping[str, Parameter]],
    there: Sequence[Mapping[str, Parameter]],
    places: Sequence[int],
    stds: float,
) -> list[tuple[int, str]]:
    """Return places and names of the parameters that differ by more than so many standard deviations of both."""
    return [
        (place, name)
        for place in places
        for name, one in here[place].items()
        if abs(there[place][name].value - one.value) > stds * np.hypot(one.std, there[place][name].std)
    ]


def widened(own: Mapping[str, Parameter], other: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return parameters for which what those of a fit as good differ by is one more standard deviation."""
    return {
        name: replace(one, std=float(np.hypot(one.std, other[name].value - one.value))) if name in other else one
        for name, one in own.items()
    }
