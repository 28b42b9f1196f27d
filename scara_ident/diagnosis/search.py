"""The search: one effect after another, the one that helps most on data that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.bank import Candidate, stack, with_candidates
from scara_ident.diagnosis.decision import Decision, decide
from scara_ident.diagnosis.examination import examine
from scara_ident.effects import CATALOGUE, Effect, Scene
from scara_ident.effects.measurement import shifted
from scara_ident.estimators import Estimate
from scara_ident.estimators.least_squares import least_squares, residual_noise
from scara_ident.evidence import Evidence, gather_all
from scara_ident.model import TorqueModel
from scara_ident.motion import motion_of, stretches
from scara_ident.recording import Recording

Array = NDArray[np.float64]

# More effects than this at once are not believed.
MOST_EFFECTS = 6
# Families whose best member gains at least this share of the best are refined before one is chosen.
NEAR_BEST = 0.6
MOST_REFINED = 4
# Points on the line between neighbouring scan points, and rounds of narrowing.
LINE_POINTS = 7
LINE_ROUNDS = 4
# Effects that act on predicted loads are fitted again until no base parameter moves by this many std.
SETTLING_ROUNDS = 4
SETTLED = 0.1
# A delay is corrected in the data until a further correction is below this, s.
DELAY_STEP = 2e-5
DELAY = "time_delay"


@dataclass(frozen=True, eq=False)
class Step:
    """One effect let in.

    Attributes
    ----------
    decision : Decision
    evidence : tuple of Evidence
        Of the training recordings with the effects so far.
    estimate : Estimate
        With the effects so far.
    """

    decision: Decision
    evidence: tuple[Evidence, ...]
    estimate: Estimate


@dataclass(frozen=True, eq=False)
class Search:
    """How the search went.

    Attributes
    ----------
    base : TorqueModel
    scene : Scene
        At the end.
    bands : tuple of float or None
    start : Estimate
        Of the base model.
    start_evidence : tuple of Evidence
    steps : tuple of Step
        The effects let in, in their order.
    chosen : tuple of Candidate
        The effects that stayed.
    delay : tuple of (float, float) or None
        Delay corrected in the data and its standard deviation, s.
    decisions : tuple of Decision
        On the best member of every family at the end, rejected ones included.
    tried : int
        Candidates and scan points tried.
    recordings : tuple of Recording
        The training recordings as corrected.
    """

    base: TorqueModel
    scene: Scene
    bands: tuple[float | None, ...]
    start: Estimate
    start_evidence: tuple[Evidence, ...]
    steps: tuple[Step, ...]
    chosen: tuple[Candidate, ...]
    delay: tuple[float, float] | None
    decisions: tuple[Decision, ...]
    tried: int
    recordings: tuple[Recording, ...]

    @property
    def model(self) -> TorqueModel:
        """The base model with the effects that stayed."""
        return model_with(self.scene, self.chosen)


def model_with(scene: Scene, chosen: Sequence[Candidate]) -> TorqueModel:
    """Return the base model with effects as further terms."""
    if not chosen:
        return scene.model
    terms = tuple(candidate.term(scene) for candidate in chosen)
    return TorqueModel(scene.model.name, scene.robot, (*scene.model.terms, *terms))


def search(
    model: TorqueModel,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    *,
    catalogue: Sequence[Effect] = CATALOGUE,
    progress: Callable[[str], None] = lambda step: None,
) -> Search:
    """Find what the model lacks.

    Parameters
    ----------
    model : TorqueModel
        The base model.
    recordings : sequence of Recording
    bands : sequence of float or None, one per joint
    catalogue : sequence of Effect, optional
        Families to try.
    progress : callable, optional
        Called with the name of every step.

    Returns
    -------
    Search
    """
    data = tuple(recordings)
    start_evidence = gather_all(model, data, bands)
    start = weighted_fit(model, start_evidence)
    scene = _scene(model, start.value, data, bands)
    candidates = [Candidate(effect, member) for effect in catalogue for member in effect.members(scene)]
    tried = max(1, len(candidates))
    chosen: list[Candidate] = []
    steps: list[Step] = []
    delay: tuple[float, float] | None = None
    weights = start.weights
    decisions: list[Decision] = []
    while True:
        progress(f"trying {len(candidates)} candidates" + (f" beside {len(chosen)} found" if chosen else ""))
        decisions = _examine_all(scene, data, bands, weights, chosen, candidates, tried)
        if len(steps) >= MOST_EFFECTS:
            break
        winner = _choose(scene, data, bands, weights, chosen, decisions, tried)
        if winner is None:
            break
        if is_delay(winner.candidate):
            data, delay = _correct_delay(data, winner, delay)
        else:
            chosen.append(winner.candidate)
            candidates = [item for item in candidates if item.label(scene) != winner.label]
        fitted = model_with(scene, chosen)
        evidence = gather_all(fitted, data, bands)
        estimate = weighted_fit(fitted, evidence)
        weights = estimate.weights
        scene = replace(scene, value=estimate.value[: len(model.columns)])
        repeated = bool(steps) and steps[-1].decision.label == winner.label
        steps[len(steps) - repeated :] = [Step(winner, evidence, estimate)]
        if repeated and delay is not None and abs(winner.examination.value[0]) < DELAY_STEP:
            candidates = [item for item in candidates if item.label(scene) != winner.label]
    kept = _backward(scene, data, bands, weights, chosen, tried)
    scene = _settle(scene, data, bands, kept)
    steps = [step for step in steps if step.decision.candidate in kept or is_delay(step.decision.candidate)]
    return Search(
        model, scene, tuple(bands), start, start_evidence, tuple(steps), tuple(kept), delay,
        tuple(decisions), tried, data,
    )  # fmt: skip


def is_delay(candidate: Candidate) -> bool:
    """Whether a candidate is the delay of all joints, which is corrected in the data."""
    return candidate.effect.name == DELAY and candidate.member.joint is None


def weighted_fit(model: TorqueModel, evidence: Sequence[Evidence]) -> Estimate:
    """Fit with each joint weighted by its residual, which is found in two rounds."""
    first = least_squares(model, evidence, np.ones(model.robot.n), "wls")
    return least_squares(model, evidence, 1.0 / residual_noise(first, evidence), "wls")


def _settle(
    scene: Scene, recordings: Sequence[Recording], bands: Sequence[float | None], chosen: Sequence[Candidate]
) -> Scene:
    """Repeat the fit until the loads that the effects are predicted from are those of the estimate."""
    for _ in range(SETTLING_ROUNDS if chosen else 0):
        model = model_with(scene, chosen)
        estimate = weighted_fit(model, gather_all(model, recordings, bands))
        value = estimate.value[: len(scene.model.columns)]
        moved = np.max(np.abs(value - scene.value) / np.maximum(estimate.std[: len(value)], np.finfo(float).tiny))
        scene = replace(scene, value=value)
        if moved < SETTLED:
            break
    return scene


def _scene(model: TorqueModel, value: Array, recordings: Sequence[Recording], bands: Sequence[float | None]) -> Scene:
    robot = model.robot
    travel, speed = np.zeros(robot.n), np.zeros(robot.n)
    longest, slowest = 0.0, np.inf
    start: dict[str, float] = {}
    for recording in recordings:
        start[recording.name] = float(recording.time[0])
        longest = max(longest, float(recording.time[-1] - recording.time[0]))
        travel = np.maximum(travel, np.ptp(recording.position, axis=1))
        for part in stretches(recording):
            slowest = min(slowest, part.rate)
            speed = np.maximum(speed, np.max(np.abs(motion_of(part, bands).v), axis=1))
    band = max((band for band in bands if band is not None), default=0.45 * slowest)
    return Scene(model, value, longest, float(slowest), band, travel, speed, start)


def _examine_all(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
    candidates: Sequence[Candidate],
    tried: int,
) -> list[Decision]:
    """Examine candidates beside the base model and the effects chosen so far."""
    if not candidates:
        return []
    extended, bank = with_candidates(scene, [*chosen, *candidates])
    rows = stack(gather_all(extended, recordings, bands), weights)
    base = len(scene.model.columns)
    groups = [list(range(base + place.start, base + place.stop)) for place in bank.places]
    fixed = [*range(base), *(k for group in groups[: len(chosen)] for k in group)]
    found = examine(rows, fixed, groups[len(chosen) :])
    return [decide(item, result, scene, tried) for item, result in zip(candidates, found, strict=True)]


def _choose(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
    decisions: Sequence[Decision],
    tried: int,
) -> Decision | None:
    """Refine the best families and return the best acceptable member of them."""
    best: dict[str, Decision] = {}
    for decision in decisions:
        held = best.get(decision.label)
        if held is None or (decision.accepted, decision.examination.held_out) > (
            held.accepted,
            held.examination.held_out,
        ):
            best[decision.label] = decision
    accepted = sorted((item for item in best.values() if item.accepted), key=lambda item: -item.examination.held_out)
    if not accepted:
        return None
    leaders = [item for item in accepted if item.examination.held_out >= NEAR_BEST * accepted[0].examination.held_out][
        :MOST_REFINED
    ]
    refined = refine(scene, recordings, bands, weights, chosen, leaders, tried)
    sound = [item for item in refined if item.accepted]
    return max(sound, key=lambda item: item.examination.held_out, default=None)


def refine(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
    leaders: Sequence[Decision],
    tried: int,
) -> list[Decision]:
    """Refine the nonlinear parameters of several candidates on lines that narrow about the best point so far."""
    current = list(leaders)
    for round_ in range(LINE_ROUNDS):
        variants = [
            (place, item) for place, held in enumerate(current) for item in _line(scene, held.candidate, round_)
        ]
        if not variants:
            break
        found = _examine_all(scene, recordings, bands, weights, chosen, [item for _, item in variants], tried)
        for (place, _), decision in zip(variants, found, strict=True):
            held = current[place]
            if decision.examination.gain > held.examination.gain and (decision.accepted or not held.accepted):
                current[place] = decision
    return current


def _line(scene: Scene, candidate: Candidate, round_: int) -> list[Candidate]:
    """Return variants of a candidate on a line for each nonlinear parameter, a third as long every round."""
    variants = []
    for k, knob in enumerate(candidate.effect.knobs):
        value = candidate.member.knobs[k]
        reach = _spacing(scene, candidate, k) * (2.0 / (LINE_POINTS - 1)) ** round_
        offsets = np.linspace(-reach, reach, LINE_POINTS)
        points = value * np.exp(offsets) if knob.logarithmic else value + offsets
        for point in points:
            if abs(point - value) > 1e-12 * abs(value) and knob.lower <= point <= knob.upper:
                knobs = list(candidate.member.knobs)
                knobs[k] = float(point)
                variants.append(candidate.at(knobs))
    return variants


def _spacing(scene: Scene, candidate: Candidate, k: int) -> float:
    """Distance to the next scan point of a nonlinear parameter, in its logarithm where it is scanned so."""
    knob = candidate.effect.knobs[k]
    grid = np.array(sorted({member.knobs[k] for member in candidate.effect.members(scene)}))
    if knob.logarithmic:
        return float(np.min(np.diff(np.log(grid)))) if len(grid) > 1 else float(np.log(2.0))
    return float(np.min(np.diff(grid))) if len(grid) > 1 else 0.1 * (knob.upper - knob.lower)


def _correct_delay(
    recordings: Sequence[Recording], decision: Decision, delay: tuple[float, float] | None
) -> tuple[tuple[Recording, ...], tuple[float, float]]:
    """Shift the effort of all recordings by the delay found."""
    step = float(decision.examination.value[0])
    std = float(np.sqrt(decision.examination.covariance[0, 0]))
    total = step + (delay[0] if delay else 0.0)
    return tuple(shifted(recording, step) for recording in recordings), (total, std)


def _backward(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    weights: Array,
    chosen: Sequence[Candidate],
    tried: int,
) -> list[Candidate]:
    """Drop, one at a time, effects that the others have made superfluous."""
    kept = list(chosen)
    while len(kept) > 1:
        decisions = [
            _examine_all(scene, recordings, bands, weights, kept[:k] + kept[k + 1 :], [kept[k]], tried)[0]
            for k in range(len(kept))
        ]
        weakest = min(range(len(kept)), key=lambda k: decisions[k].gain)
        if decisions[weakest].accepted:
            break
        kept.pop(weakest)
    return kept
