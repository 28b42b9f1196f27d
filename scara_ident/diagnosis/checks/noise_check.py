"""Whether position noise, or ringing of the positions, produces an effect rather than the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.correction import Correction, corrected, taken_out
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.candidate_tests import Examination, coefficients, examine
from scara_ident.diagnosis.testing.cluster_test import significance
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Scene
from scara_ident.errors import RecordingError
from scara_ident.estimation.noise_bias import noisy
from scara_ident.estimation.run_offsets import offsets_on
from scara_ident.motion.position_noise import noise_sizes
from scara_ident.motion.rest import stepping_speeds

# How each reason begins that positions with less noise would settle.
BY_NOISE = "the noise of the positions"
# Friction that changes below the speed at which a joint makes as many steps in a period of its positions' filter is the work of
# a controller that answers each step: behind 12 bits friction that jumps seemed to grow over 4 times the speed of one step; twice that is asked.
STEPS_OF_SPEED = 8.0


def noise_objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where an effect is no longer to be believed, or mostly gone, once the positions' noise is taken from it.

    What a candidate's column has in common with the residual grows linearly with the variance of the noise in both.
    With the noise twice, the difference is the noise's share (Cook and Stefanski 1994).

    Parameters
    ----------
    step : SelectionStep
        The model that the candidate was tried beside.
    decision : Decision
        That lets it in.
    """
    unresolved = step.columns.unresolved_for(decision.candidate.member.joint) or within_a_step(step, decision.candidate)
    return (
        unresolved
        or _gone_further_down(step, decision)
        or made_by_noise(step, decision)
        or made_through_the_controller(step, decision)
    )


def made_by_noise(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where little of an effect is left, or little that is sure, with the noise of the positions taken off.

    Parameters
    ----------
    step, decision
        See `noise_objection`.
    """
    found, criteria = decision.examination, step.criteria
    (left,) = _each_without_noise(step, [decision])
    share = _share(found, left)
    if share >= 1.0:
        # What is no smaller without the noise was not made by it.
        return None
    p_value = _left_of(found, left).p_value
    if share < criteria.min_without_noise:
        return f"{BY_NOISE} causes it: without that noise {share:.0%} of it is left, p = {p_value:.1e}"
    # Believed as it is, it may pass what is asked by little, so that most of it need not pass. Of a correction less is asked.
    if decision.gain * share < criteria.min_gain <= decision.gain:
        return (
            f"{BY_NOISE} lifts it above the detection limit: without that noise {share:.1%} of it is left, which "
            f"removes {decision.gain * share:.2%} of the squared residual, {criteria.min_gain:.0%} is required"
        )
    if p_value * step.tried > criteria.family_error:
        return (
            f"{BY_NOISE} makes it look more significant than it is: without that noise {share:.1%} of it is left, p = "
            f"{p_value:.1e} instead of {found.p_value:.1e}; with {step.tried} candidates tried "
            f"{criteria.family_error / step.tried:.1e} is required"
        )
    return None


def within_a_step(step: SelectionStep, candidate: Candidate) -> str | None:
    """Say so where an effect turns on a way or a speed that the encoder's steps hide: it mends the sign of friction where they spoil it."""
    joint = candidate.member.joint
    way, speed = candidate.effect.turns_on(candidate.member)
    if joint is None or not (np.isfinite(way) or np.isfinite(speed)):
        return None
    data, unit = step.observations.data, step.scene.robot.position_unit(joint)
    steps = max((part[joint][0] or 0.0 for parts in noise_sizes(data) for part in parts), default=0.0)
    if way < steps:
        return f"it depends on {way:.2g} {unit} of motion, less than a step of the encoder, {steps:.2g} {unit}"
    changes = np.concatenate([_changes_at_turns(part.motion.v[joint]) for part in data.stretches])
    passed = float(np.sqrt(np.mean(changes**2))) if len(changes) else 0.0
    if speed < passed:
        return (
            f"friction would differ only below {speed:.2g} {unit}/s, and a reversing joint passes that speed within "
            f"one sample: its speed changes by {passed:.2g} {unit}/s per sample"
        )
    stepping = max(float(stepping_speeds(part.stretch, part.motion.cuts)[joint]) for part in data.stretches)
    if speed < STEPS_OF_SPEED * stepping:
        return (
            f"friction would differ only below {speed:.2g} {unit}/s, where the controller's reaction to the encoder's "
            f"steps shakes the joint: below {stepping:.2g} {unit}/s the steps come one by one"
        )
    return None


def _changes_at_turns(v: Array) -> Array:
    """Return by how much a speed changes from the last sample before each turn to the first one behind it."""
    return np.asarray(np.diff(v)[np.signbit(v[1:]) != np.signbit(v[:-1])])


def _gone_further_down(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where a coefficient that is the same at all frequencies is another one in the lower part of the band.

    What a controller answers the noise of positions with is in the torque, as that noise is in the column, and grows with
    frequency; as does what a clearance or another link does, which is no multiple of the column.
    """
    candidate, criteria, whole = decision.candidate, step.criteria, decision.examination
    if not candidate.effect.same_at_all_frequencies:
        return None
    out = None
    if candidate.corrects_data and not candidate.effect.of_each_recording:
        # The noise of positions in its column makes a first estimate too small, where there is little of it further down.
        out = taken_out(step, candidate)[1]
        whole = _grown_to(whole, out.value)
    below = _examined_below(step, candidate, criteria.lower_band, out)
    if below is None:
        return None
    found, band = below
    change = np.max(np.abs(found.value - whole.value))
    p_value = _differing(found, whole)
    if p_value > criteria.significant or change < criteria.lower_change * np.max(np.abs(whole.value)):
        return None
    name, unit = candidate.effect.coefficients[0].name, candidate.effect.coefficients[0].unit
    return (
        f"{name} would be {whole.value[0]:.2g} {unit}, but {found.value[0]:.2g} {unit} below {band:.2g} Hz "
        f"(p = {p_value:.1e}); a real one would have the same value there"
    )


def made_through_the_controller(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where the noise of positions could make all of an effect by a controller's answer to it, and little is left below.

    A controller that damps by differences of coarse positions has their noise in the torque: that in the column is no
    stranger to that in the residual, as it is to what `made_by_noise` adds, and what it makes is of any size and sign. It can
    explain no more of the residual than its share of the column's square (Cauchy and Schwarz). Where that is as much as the
    effect removes, the frequencies decide: what an arm has is the same in the lower part of the band, and the noise of
    positions, differentiated, is hardly there.

    Parameters
    ----------
    step, decision
        See `noise_objection`.
    """
    candidate, criteria, whole = decision.candidate, step.criteria, decision.examination
    if noise_of_column(step, decision) < decision.gain:
        return None
    size = float(whole.value @ whole.products @ whole.value)
    # Of a fast resonance little is in so low a part: half-way to it, by octaves, there is more.
    for share in (criteria.lower_band, float(np.sqrt(criteria.lower_band))):
        below = _examined_below(step, candidate, share)
        if below is None:
            continue
        found, band = below
        left = float(whole.value @ whole.products @ found.value) / size
        p_value = _differing(found, whole)
        # Noise in the column alone makes the whole band's too small.
        if left <= 1.0 - criteria.lower_change and p_value <= criteria.significant:
            return (
                f"{BY_NOISE} could cause all of it through the controller's reaction: below {band:.2g} Hz it has "
                f"{left:.0%} of its size (p = {p_value:.1e}); a real one would have the same value there"
            )
    return None


def noise_of_column(step: SelectionStep, decision: Decision) -> float:
    """Return the share of the squared torque of an effect, less what the model spans of it, that noise of positions makes.

    Parameters
    ----------
    step, decision
        See `noise_objection`.
    """
    found, twin = decision.examination, step.noisier
    whole = float(found.value @ found.products @ found.value)
    (rows,) = twin.rows(twin.scene, [decision.candidate])
    _, products = coefficients(twin.model, rows, step.criteria)
    return float(found.value @ products @ found.value) / whole - 1.0 if whole > 0.0 else 0.0


def _grown_to(found: Examination, value: Array) -> Examination:
    """Return what is said of coefficients that are as unsure as they were for their size, and larger or smaller."""
    size = float(np.linalg.norm(found.value))
    grown = float(np.linalg.norm(value)) / size if size > 0.0 else 1.0
    return replace(found, value=value, covariance=grown**2 * found.covariance)


def _examined_below(
    step: SelectionStep, candidate: Candidate, share: float, out: Correction | None = None
) -> tuple[Examination, float] | None:
    """Return what is said of a candidate in the lower part of the band, this share of it, and where that ends, Hz.

    None where a recording is too short for that part.

    Parameters
    ----------
    out : Correction, optional
        Of the candidate, taken out of the data before what is left of it is looked for.
    """
    narrower = tuple(share * (band or step.scene.band) for band in step.observations.data.bands)
    try:
        columns = step.columns.at(narrower)
    except RecordingError:
        return None
    if out is not None:
        columns = columns.beside(columns.observations.with_torque(corrected(columns.observations.data, out)))
    # What the filter of so narrow a band does to the motion itself is none of the candidate's.
    beside = [Candidate(*item) for item in candidate.effect.distinguished_from(step.scene, candidate.member)]
    variation = offsets_on(columns.observations, step.offsets)
    below = replace(step, columns=columns, variation=variation)
    model = replace(below, chosen=(*step.chosen, *beside)).model if beside else below.model
    (found,) = examine(model, below.rows(below.scene, [candidate]), step.criteria)
    return found if out is None else replace(found, value=found.value + out.value), max(narrower)


def _differing(found: Examination, whole: Examination) -> float:
    """Return the probability that coefficients in a part of the band differ so much by chance."""
    spread = found.covariance + whole.covariance
    return significance(found.value - whole.value, spread, min(found.freedom, whole.freedom), found.products)


def less_noise(step: SelectionStep, decisions: Sequence[Decision], scene: Scene | None = None) -> list[Decision]:
    """Return decisions with what is left beside a model once the share of the positions' noise is taken off, where it is less.

    Parameters
    ----------
    step : SelectionStep
        The model.
    scene : Scene, optional
        By whose columns they are judged; default: the step's.
    """
    if not decisions or not noisy(step.observations.data):
        return list(decisions)
    judged, result = step.judge([item.candidate for item in decisions], scene), []
    for item, now, left in zip(decisions, judged, _each_without_noise(step, judged, scene), strict=True):
        found, share = now.examination, _share(now.examination, left)
        less = replace(now, examination=_left_of(found, left), gain=share * now.gain, why=item.why)
        result.append(less if share < 1.0 else item)
    return result


def _each_without_noise(step: SelectionStep, decisions: Sequence[Decision], scene: Scene | None = None) -> list[Array]:
    """Return `without_noise` of each, examined beside a model by the columns of a scene."""
    noisier, candidates = step.noisier, [item.candidate for item in decisions]
    if scene is None:
        rows = noisier.rows(noisier.scene, candidates)
    else:
        rows = noisier.rows_at_hand(replace(scene, columns=noisier.scene.columns), candidates)
    return [
        without_noise(item.examination, *coefficients(noisier.model, own, step.criteria))
        for item, own in zip(decisions, rows, strict=True)
    ]


def _share(found: Examination, left: Array) -> float:
    """Return the share of what a candidate removes that is left with other coefficients; 1 of nothing."""
    whole = float(found.value @ found.products @ found.value)
    return float(left @ found.products @ left) / whole if whole > 0.0 else 1.0


def _left_of(found: Examination, left: Array) -> Examination:
    """Return what is said of a candidate with the coefficients that are left of it."""
    tested = found.tested - found.value + left
    before, after = (
        significance(each, found.covariance, found.freedom, found.products) for each in (found.tested, tested)
    )
    # The test knew the freedom of each direction, of which the least is kept: what changes is by how much that says.
    p_value = min(1.0, found.p_value * after / before) if before > 0.0 else after
    return replace(found, value=left, tested=tested, p_value=p_value)


def without_noise(found: Examination, value: Array, products: Array) -> Array:
    """Return coefficients without the share of the positions' noise, from those with it twice and their products."""
    share = products @ value - found.products @ found.value
    return np.asarray(found.value - np.linalg.pinv(found.products, rcond=1e-9, hermitian=True) @ share)


def noise_left(step: SelectionStep, candidate: Candidate) -> float:
    """Return how much of the weighted squared residual beside a candidate the positions' noise makes.

    It is what as much noise once more adds, as in `noise_objection`. What runs differ by is left in both.
    """
    left = []
    for each in (replace(step, variation=None), replace(step, variation=None).noisier):
        (own,) = each.rows(each.scene, [candidate])
        value, products = coefficients(each.model, own, step.criteria)
        left.append(float(np.sum(each.model.squares) - value @ products @ value))
    return left[1] - left[0]
