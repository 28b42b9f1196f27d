"""What a search comes to: in which band, whether what is left is noise, and which effects are worth their name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.lack_of_fit import LackOfFit, lack_of_fit
from scara_ident.diagnosis.screening import Dependence, screen
from scara_ident.diagnosis.search import Search, search
from scara_ident.effects import Effect
from scara_ident.estimation import Estimate, JointError
from scara_ident.estimation.bands import choose_bands
from scara_ident.estimation.estimate import joint_error
from scara_ident.estimation.information import merge
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import Evidence, gather_all
from scara_ident.model.model import TorqueModel
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]

# Share of the squared residual that signals must explain on held-out trajectories to be called a remainder.
REMAINDER = 0.08
# A repeatable remainder larger than the noise, within the band, is one whatever it depends on.
REMAINDER_TO_NOISE = 1.0
SIGNIFICANT = 0.01
# With what was found the search is repeated where the band becomes this many times as wide, so often at the most.
WIDER = 1.3
MOST_WIDENINGS = 2
# Where a joint swings within the band, or something is left over, bands this much narrower are tried for an elastic one.
NARROWER = (0.63, 0.4)
# The columns of an effect with a resonance hold in a band that ends so far below it.
BELOW_RESONANCE = 1.5
# Where most of what repeats stays unexplained, an effect that removes less than this share of it stands for another.
LEAST_OF_REPEATABLE = 0.5
MOST_DEMOTIONS = 3


@dataclass(frozen=True)
class Unexplained:
    """A repeatable remainder that no effect explains.

    Attributes
    ----------
    joint : str
    signals : tuple of str
        What it depends on; empty where no signal or pair of signals shows it.
    rms : float
        Its size within the band, N m or N.
    explained : float
        Share of the squared residual that the signals explain on held-out trajectories.
    """

    joint: str
    signals: tuple[str, ...]
    rms: float
    explained: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A search and what is left after it.

    Attributes
    ----------
    search : Search
    after : Estimate
        With the effects found.
    training : tuple of Evidence
        Of the training recordings with the effects found.
    fit_before, fit_after : tuple of LackOfFit
        Per joint; empty without repetitions.
    dependences : tuple of Dependence
        What the remainder depends on, ranked.
    unexplained : Unexplained or None
    demoted : tuple of str
        Effects that were found and not counted, and why.
    """

    search: Search
    after: Estimate
    training: tuple[Evidence, ...]
    fit_before: tuple[LackOfFit, ...]
    fit_after: tuple[LackOfFit, ...]
    dependences: tuple[Dependence, ...]
    unexplained: Unexplained | None
    demoted: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be searched.

    Attributes
    ----------
    model : TorqueModel
    recordings : tuple of Recording
    catalogue : tuple of Effect
    progress : callable
    """

    model: TorqueModel
    recordings: tuple[Recording, ...]
    catalogue: tuple[Effect, ...]
    progress: Callable[[str], None]


def outcome_of(task: Task, bands: Sequence[float | None], *, free: bool) -> Outcome:
    """Search for what a model lacks in the band where that can be told.

    Parameters
    ----------
    task : Task
    bands : sequence of float or None, one per joint
    free : bool
        Whether another band may be chosen.
    """
    found = _searched(task, bands, ())
    for _ in range(MOST_WIDENINGS if free else 0):
        wider = max(choose_bands(found.search.model, found.search.recordings).bands) if found.search.chosen else 0.0
        if wider < WIDER * _band(found):
            break
        # What was missing had hidden how far up the motion explains the torque, and other effects with it.
        found = _searched(task, (wider,) * len(bands), ())
    if free and (found.unexplained is not None or not _below_resonance(found)):
        found = _narrowed(task, found)
    return _without_proxies(task, found)


def _searched(task: Task, bands: Sequence[float | None], without: Collection[str]) -> Outcome:
    found = search(
        task.model, task.recordings, bands, catalogue=task.catalogue, without=without, progress=task.progress
    )
    task.progress("testing what is left")
    final = found.model
    training = gather_all(final, found.recordings, bands)
    after = wls(final, training)
    fit_before = lack_of_fit(task.model, found.start.value, task.recordings, bands)
    fit_after = lack_of_fit(final, after.value, found.recordings, bands)
    dependences = screen(final, after.value, found.recordings, bands)
    return Outcome(found, after, training, fit_before, fit_after, dependences, _unexplained(fit_after, dependences))


def _unexplained(fit: Sequence[LackOfFit], dependences: Sequence[Dependence]) -> Unexplained | None:
    if dependences and dependences[0].explained > REMAINDER:
        top = dependences[0]
        # A pair must say clearly more than its better half.
        for other in dependences[1:]:
            if other.joint == top.joint and len(other.signals) == 1 and other.explained > 0.8 * top.explained:
                top = other
                break
        return Unexplained(top.joint, top.signals, top.rms, top.explained)
    for joint in fit:
        if _left_over(joint):
            return Unexplained(joint.joint, (), joint.missing, 0.0)
    return None


def _left_over(fit: LackOfFit) -> bool:
    return fit.missing > REMAINDER_TO_NOISE * fit.noise and fit.p_value < SIGNIFICANT


def _band(found: Outcome) -> float:
    return max(band or np.inf for band in found.search.bands)


def _resonances(found: Search) -> list[float]:
    """Return the resonance of every effect found that has one, Hz."""
    found_at = (candidate.effect.resonance(candidate.member) for candidate in found.chosen)
    return [frequency for frequency in found_at if frequency is not None]


def _below_resonance(found: Outcome) -> bool:
    return all(resonance >= BELOW_RESONANCE * _band(found) for resonance in _resonances(found.search))


def _narrowed(task: Task, wide: Outcome) -> Outcome:
    """Look for an effect with a resonance in bands that end below it, and keep what leaves nothing over."""
    resonant = [effect for effect in task.catalogue if effect.resonant]
    band = _band(wide)
    if not resonant or not np.isfinite(band):
        return wide
    for share in NARROWER:
        bands = (share * band,) * len(wide.search.bands)
        if not search(task.model, task.recordings, bands, catalogue=resonant).chosen:
            continue
        found = _searched(task, bands, ())
        if found.unexplained is None and _resonances(found.search) and _below_resonance(found):
            return found
    return wide


def _without_proxies(task: Task, found: Outcome) -> Outcome:
    """Search again without effects that stand for one that is not in the catalogue."""
    demoted: dict[str, str] = {}
    for _ in range(MOST_DEMOTIONS):
        proxies = _proxies(found)
        if not proxies:
            break
        demoted |= proxies
        found = _searched(task, found.search.bands, tuple(demoted))
    if not demoted:
        return found
    return Outcome(
        found.search, found.after, found.training, found.fit_before, found.fit_after, found.dependences,
        found.unexplained, tuple(demoted.values()),
    )  # fmt: skip


def _proxies(found: Outcome) -> dict[str, str]:
    """Return the effects that remove little of a remainder most of which stays, and the words for it."""
    if found.unexplained is None or not found.fit_after:
        return {}
    joints = found.search.base.robot.joints
    noise = {fit.joint: fit.noise for fit in found.fit_after}
    left = {fit.joint for fit in found.fit_after if _left_over(fit)} | {found.unexplained.joint}
    proxies = {}
    before = joint_rms(found.search.start.value, found.search.start_evidence)
    for step in found.search.steps:
        after = joint_rms(step.estimate.value, step.evidence)
        owner = step.decision.candidate.joint(found.search.scene)
        repeats = removed = 0.0
        for joint, old, new in zip(joints, before, after, strict=True):
            if joint in noise and owner in (joint, None) and old is not None and new is not None:
                repeats += (old / noise[joint]) ** 2 - 1.0
                removed += (old**2 - new**2) / noise[joint] ** 2
        before = after
        if (owner is None or owner in left) and removed < LEAST_OF_REPEATABLE * repeats:
            share = max(0.0, removed / repeats)
            proxies[step.decision.label] = (
                f"{step.decision.label} is not counted: it would remove {share:.0%} of what repeats, and most of the "
                "rest stays unexplained"
            )
    return proxies


def joint_rms(value: Array, evidence: Sequence[Evidence]) -> list[float | None]:
    """Return the rms of each joint over recordings, within the band; None without rows."""
    return [error.rms if error else None for error in joint_errors(value, evidence)]


def joint_errors(value: Array, evidence: Sequence[Evidence]) -> list[JointError | None]:
    """Return the error of each joint over all recordings together."""
    if not evidence:
        return []
    joints = len(evidence[0].unfiltered)
    return [
        joint_error(merge(item.joint(j) for item in evidence), merge(item.unfiltered[j] for item in evidence), value)
        for j in range(joints)
    ]
