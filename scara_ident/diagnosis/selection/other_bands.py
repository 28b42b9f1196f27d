"""A search whose effects are estimated in other bands than those in which they were found."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.diagnosis.candidates.candidates import CandidateColumns, columns_at_hand
from scara_ident.diagnosis.fitting.at_estimate import at_estimate
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.search import Search, scene_of
from scara_ident.diagnosis.selection.search_state import Step
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.estimation import wls
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.observations import observe
from scara_ident.estimation.run_offsets import offsets_on, rms_of


def in_bands_of(found: Search, step: SelectionStep) -> Search:
    """Return a search with all that it tells fitted and judged in the bands of a step; what stayed and what did not is as it was.

    Parameters
    ----------
    found : Search
    step : SelectionStep
        The effects that stayed, fitted in other bands.
    """
    bands, model = step.observations.data.bands, found.base
    uncorrected = step.observations
    if found.correction is not None:
        uncorrected = observe(model, found.uncorrected.data.at(bands))
    start = wls(uncorrected)
    first = replace(scene_of(model, start.value, uncorrected), armatures=found.first.armatures)
    step = tune(replace(step, weights=value_and_weights(observed(step), step.offsets)[1]))
    judged = step.judge([item.candidate for item in found.decisions], first)
    # What was refused for more than its tests stays so.
    decisions = tuple(
        now.refused(item.why) if now.accepted else now for item, now in zip(found.decisions, judged, strict=True)
    )
    steps = tuple(_again(item, found, step) for item in found.steps)
    return replace(
        found, step=step, uncorrected=uncorrected, start=start, steps=steps, decisions=decisions, first=first
    )


def _again(item: Step, found: Search, step: SelectionStep) -> Step:
    """Return one effect let in with what was in the model then fitted in the bands of a step."""
    columns, bands = step.columns, step.observations.data.bands
    if item.data is not found.data:
        columns = CandidateColumns(observe(found.base, item.data.at(bands)))
    observations = columns.observations
    scene = replace(item.scene, band=step.scene.band, columns=columns_at_hand(observations))
    variation = offsets_on(observations, step.offsets)
    own = tune(replace(step, scene=scene, columns=columns, chosen=item.chosen, variation=variation, minima=()))
    fitted = observed(own)
    value, _ = value_and_weights(fitted, own.offsets)
    scene = at_estimate(own.scene, own.chosen, value)
    left = rms_of(value, fitted, own.offsets)
    return replace(item, scene=scene, chosen=own.chosen, data=observations.data, value=value, rms=left)
