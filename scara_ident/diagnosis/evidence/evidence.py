"""Whether the residual of each joint was shown to be noise, and whether anything else would have been detected.

That nothing was found says little where nothing could have been found. A joint's residual is shown to be noise where
repetitions bound what repeats of it, or where it is white within the band, so that no motion of the arm, whose power is
not spread evenly over frequency, can be in more than a small share of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.cluster_test import needed
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit
from scara_ident.effects import Parameter
from scara_ident.estimation import Estimate
from scara_ident.estimation.explained_power import binned_power
from scara_ident.estimation.noise_bias import noise_torque
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.residuals import Residuals
from scara_ident.motion.prepared import PreparedData

# Bins of frequency within the band that a residual's power is compared in.
BINS = 12
# Share of the band in which the low-pass leaves the residual as it is.
UNTOUCHED = 0.8
# Noise of the positions by one draw that has more of the residual's power than this is not what it was taken for.
MAX_POSITION_NOISE = 1.5
# Probability below which what repeats is doubted to be noise where it is `far_above_noise`: nothing is claimed by it.
DOUBTED = 0.05


@dataclass(frozen=True)
class Evidence:
    """What is known of one joint's residual.

    Attributes
    ----------
    shown : bool
        Whether it was shown to be noise, by recordings that would have shown otherwise.
    by : {"repetition", "whiteness", ""}
        What showed that it is noise, or that not all of it is.
    why : str
        In words.
    limit : float
        Share of its square that half of the effects tried on it would have to remove to come in; NaN where none was
        tried.
    lacks : bool
        Whether the model surely lacks something there: more repeats than filters and encoders may leave.
    apart : str
        The recording that leaves more than all others; empty where none does.
    """

    joint: str
    shown: bool
    by: str
    why: str
    limit: float
    lacks: bool = False
    apart: str = ""


def evidence(
    found: Search,
    residuals: Residuals,
    fit: Sequence[LackOfFit],
    small: Sequence[float],
    of_positions: Sequence[float],
    suspected: Sequence[Decision] = (),
    criteria: SelectionCriteria = CRITERIA,
    made: Callable[[], Sequence[Array]] | None = None,
) -> tuple[Evidence, ...]:
    """Return for each joint whether what is left was shown to be noise.

    Parameters
    ----------
    residuals : Residuals
        What is left of the training recordings.
    fit : sequence of LackOfFit
        From repetitions; empty without.
    small : sequence of float
        What may repeat on each joint all the same, as filters and encoders leave as much, N m or N.
    of_positions : sequence of float
        What of it the noise of the positions makes, which may be white.
    suspected : sequence of Decision, optional
        On effects that explain some of it and are not believed.
    made : callable, optional
        Returns what the noise of the positions makes in the torque of each stretch, shape (n, N): it is not white.
    """
    limits = detection_limits(found, criteria)
    coloured = coloured_shares(residuals)
    noise = np.full(len(coloured), "white noise", dtype=object)
    if made is not None and np.any(coloured > criteria.min_colour):
        less = coloured_shares(residuals, made())
        # What is white is shown as it is, whatever other joints need.
        mended = (coloured > criteria.min_colour) & (less < coloured)
        noise[mended], coloured[mended] = "white noise and the noise of the positions", less[mended]
    repeated = {item.joint: item for item in fit}
    # An effect found leaves something of second order, which repeats as it does.
    times = criteria.far_above_noise if found.chosen or found.correction is not None else 0.0
    doubts = dict(found.step.columns.unresolved)
    for item in suspected:
        own = item.candidate.member.joint
        for j in range(found.scene.robot.n) if own is None else (own,):
            doubts.setdefault(j, item.why)
    robot = found.scene.robot
    # Beyond the chance that one of all joints does.
    lacks = [
        joint in repeated
        and repeated[joint].p_value * robot.n < criteria.family_error
        and repeated[joint].missing > small[j]
        for j, joint in enumerate(robot.joints)
    ]
    shown = (
        Evidence(joint, False, "", doubts[j], float(limits[j]))
        if j in doubts
        else _of_joint(
            joint,
            robot.torque_unit(j),
            repeated.get(joint),
            float(coloured[j]),
            noise[j],
            float(limits[j]),
            (small[j], of_positions[j], times),
            criteria,
        )
        for j, joint in enumerate(robot.joints)
    )
    return tuple(replace(item, lacks=own and not item.shown) for item, own in zip(shown, lacks, strict=True))


def _of_joint(
    joint: str,
    unit: str,
    fit: LackOfFit | None,
    coloured: float,
    noise: str,
    limit: float,
    allowed: tuple[float, float, float],
    criteria: SelectionCriteria,
) -> Evidence:
    small, of_positions, of_effects = allowed
    repeats = fit is not None and fit.p_value < criteria.significant
    if limit > criteria.min_power:
        missing = (
            "no missing effect"
            if round(limit, 2) >= 1.0
            else f"no missing effect that makes less than {limit:.0%} of the squared residual"
        )
        why = f"{missing} would have been significant: record more"
        return Evidence(joint, False, "", why, limit)
    if fit is not None and repeats and fit.missing > small:
        why = f"{_beside(fit, unit)}; this is more than filters and encoders cause, and no effect that was tried explains it"
        return Evidence(joint, False, "repetition", why, limit)
    if fit is not None and fit.max_missing <= criteria.remainder_to_noise * fit.noise:
        why = f"by the repetitions at most {fit.max_missing:.3g} {unit} repeats, and {fit.noise:.3g} {unit} does not"
        return Evidence(joint, True, "repetition", why, limit)
    # What is that large beside the noise is doubted where it is hardly shown too, as of a few periods of a narrow band.
    far = fit is not None and fit.p_value < DOUBTED and fit.missing > criteria.far_above_noise * fit.noise
    if (
        fit is not None
        and (repeats or far)
        and fit.missing > max(of_effects * fit.noise, max(1.0, of_effects) * of_positions)
    ):
        # A ripple at many speeds is as white as noise, and repeats.
        why = f"{_beside(fit, unit)}; this is not noise, even if it is white, but filters and encoders may cause as much, "
        why += "so this alone does not say that the model lacks something"
        return Evidence(joint, False, "repetition", why, limit)
    if coloured <= criteria.min_colour:
        why = f"at most {max(coloured, 0.0):.0%} of the residual's power within the band is above {noise}"
        return Evidence(joint, True, "whiteness", why, limit)
    why = f"{coloured:.0%} of the residual's power within the band is above {noise}, and "
    why += (
        "no trajectory was repeated, so whether it repeats is not known"
        if fit is None
        else f"up to {fit.max_missing:.3g} {unit} of it may repeat, and {fit.noise:.3g} {unit} does not"
    )
    return Evidence(joint, False, "", why, limit)


def _beside(fit: LackOfFit, unit: str) -> str:
    """Say what repeats beside what does not."""
    chance = f"p = {fit.p_value:.1e}"
    return f"{fit.missing:.3g} {unit} repeats from run to run ({chance}), {fit.noise:.3g} {unit} does not"


def held_out_evidence(
    shown: Sequence[Evidence],
    training: Sequence[float | None],
    held_out: Sequence[float | None],
    unsure: Array,
    differing: Array,
    criteria: SelectionCriteria = CRITERIA,
) -> tuple[Evidence, ...]:
    """Take back what the training recordings showed where the model does not hold on others.

    Parameters
    ----------
    training, held_out : sequence of float or None
        Rms error of each joint; None without rows.
    unsure : ndarray, shape (n,)
        Rms error on the recordings held out that a right model has there, see `unsure_of_others`.
    differing : ndarray, shape (n,)
        Rms torque by which these are expected to differ from the training's, see `of_another_run`.
    """
    found = []
    for item, own, other, known, apart in zip(shown, training, held_out, unsure, differing, strict=True):
        if item.shown and own and other is not None and other > criteria.worse_held_out * own:
            why = f"the error on the held-out recordings is {other / own:.2g} times the training error"
            # The few draws of a run are known by their standard deviation alone.
            most = np.linalg.norm([criteria.worse_held_out * own, known, criteria.alike * apart])
            if other > most:
                item = replace(item, shown=False, by="", why=why)
            else:
                by = (
                    "which the uncertainty of the parameters there explains"
                    if known >= apart
                    else "which the differences between runs explain"
                )
                item = replace(item, why=f"{item.why}; {why}, {by}")
        found.append(item)
    return tuple(found)


def unsure_of_others(after: Estimate, held_out: Observations) -> Array:
    """Return the rms error of a right model on recordings held out that training's residual does not have.

    It is made by the uncertainty of the parameters, which those recordings may excite more, and by the noise of the
    positions there. Of parameters that the training leaves open nothing is counted.

    Parameters
    ----------
    held_out : Observations
        Of the same model.

    Returns
    -------
    ndarray, shape (n,)
    """
    known = np.isfinite(np.diag(after.covariance))
    covariance = np.where(np.outer(known, known), after.covariance, 0.0)
    square = noise_torque(held_out, after.value) ** 2
    for joint, rows in enumerate(held_out.by_joint):
        if rows.rows:
            factor = rows.regressor_factor
            square[joint] += max(0.0, float(np.sum((factor @ covariance) * factor))) / rows.rows
    return np.asarray(np.sqrt(square))


def detection_limits(found: Search, criteria: SelectionCriteria = CRITERIA) -> Array:
    """Return for each joint the share of its squared residual that half of the effects tried would have to remove.

    An effect is significant where its coefficients, squared and over their variance, are beyond a quantile; times what
    one standard deviation of them removes, that is the least that it must remove, and never less than is asked of its gain.

    Returns
    -------
    ndarray, shape (n,)
        NaN where no effect was tried.
    """
    from scipy.special import fdtri

    robot = found.scene.robot
    shares: list[list[float]] = [[] for _ in robot.joints]
    total = float(np.sum(found.step.model.squares))
    for decision in (*found.decisions, *(step.decision for step in found.steps)):
        examined, joint = decision.examination, decision.candidate.member.joint
        if joint is None or examined.outside < criteria.min_outside or total == 0.0:
            continue
        count = len(examined.value)
        rest = examined.freedom - count + 1.0
        if rest <= 0.0:
            shares[joint].append(1.0)
            continue
        quantile = float(fdtri(count, rest, 1.0 - criteria.family_error / found.tried)) * examined.freedom / rest
        noise = float(np.trace(examined.products @ examined.covariance))
        shares[joint].append(min(1.0, quantile * noise / total * robot.n))
    return np.array([max(float(np.median(item)), criteria.min_gain) if item else np.nan for item in shares])


def min_found(found: Search, decision: Decision, criteria: SelectionCriteria = CRITERIA) -> Mapping[str, Parameter]:
    """Return the size that an effect of one coefficient would have to have to come in; none for others.

    It must be significant, and remove as much of what is left on its joint as is asked. The standard deviation says nothing.

    Parameters
    ----------
    decision : Decision
        On one of the candidates at the end.
    """
    examined, candidate, scene = decision.examination, decision.candidate, found.scene
    if len(examined.value) != 1 or examined.outside < criteria.min_outside or not examined.products[0, 0] > 0.0:
        return {}
    errors = needed(1, examined.freedom, criteria.family_error / found.tried)
    left = float(np.sum(found.step.model.squares)) / (1 if candidate.member.joint is None else scene.robot.n)
    share = criteria.min_gain / (1.0 - criteria.min_gain)
    size = max(errors * np.sqrt(examined.covariance[0, 0]), np.sqrt(share * left / examined.products[0, 0]))
    if not np.isfinite(size):
        return {}
    sizes = candidate.effect.parameters(scene, candidate.member, np.array([size]), np.zeros((1, 1)))
    # Others, such as where a spring is at rest, stand behind it.
    return dict([next(iter(sizes.items()))])


def coloured_shares(residuals: Residuals, made: Sequence[Array] | None = None) -> Array:
    """Return for each joint the share of the residual's power within the band above that of white noise.

    The power in bins of equal width is that of white noise at the level of the median bin, and what stands out from it.

    Parameters
    ----------
    made : sequence of ndarray, shape (n, N), optional
        What of each stretch's torque is known to be noise: its power is taken off before.

    Returns
    -------
    ndarray, shape (n,)
        1 where nothing is left to look at.
    """
    data = residuals.data
    found = []
    for j in range(len(data.bands)):
        within = _power(
            data, j, [part.torque - own for part, own in zip(data.stretches, residuals.predicted, strict=True)]
        )
        mean = float(np.mean(within))
        if made is not None:
            known = _power(data, j, made)
            within = within - known if float(np.mean(known)) <= MAX_POSITION_NOISE * mean else within
        found.append(1.0 if mean == 0.0 else float(np.mean(within) - np.median(within)) / mean)
    return np.array(found)


def _power(data: PreparedData, joint: int, signals: Sequence[Array]) -> Array:
    """Return the power of a joint's signal, faded as its rows are, in bins of the part of the band that no filter touches."""
    band = data.bands[joint]
    slowest = min(part.rate for part in data.stretches)
    edges = np.linspace(0.0, UNTOUCHED * (0.5 * slowest if band is None else band), BINS + 1)
    power = np.zeros(BINS + 1)
    for part, signal in zip(data.stretches, signals, strict=True):
        if part.usable and np.any(part.used[joint]):
            inside = slice(part.trim, part.samples - part.trim)
            own = (part.fade[joint] * signal[joint])[inside]
            power += binned_power(own[None], part.rate, np.append(edges, 0.5 * part.rate))[0]
    return power[:BINS]
