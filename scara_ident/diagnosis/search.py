"""The search: one effect after another, the one that helps most on data that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.acceptance import Decision, decide
from scara_ident.diagnosis.candidate_tests import examine
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.effect_parameters import parameters_beside
from scara_ident.diagnosis.lines import line_candidates
from scara_ident.diagnosis.nonlinear_fit import tune
from scara_ident.diagnosis.table import Table, tabulate, tabulate_candidates
from scara_ident.effects import CATALOGUE, Effect, Scene
from scara_ident.estimation import Estimate
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import Evidence, gather_all
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import motion_of, stretches
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]

# More effects than this at once are not believed.
MOST_EFFECTS = 6
# Families whose best member gains at least this share of the best are refined before one is chosen.
NEAR_BEST = 0.6
MOST_REFINED = 4
# Standard deviations by which an effect must differ from none once its nonlinear parameters are free too.
TOLD = 2.5
# Points on the line between neighbouring scan points, and rounds of narrowing.
LINE_POINTS = 7
LINE_ROUNDS = 4


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
    without: Collection[str] = (),
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
    without : collection of str, optional
        Labels of candidates that are not to be tried.
    progress : callable, optional
        Called with the name of every step.

    Returns
    -------
    Search
    """
    data = tuple(recordings)
    start_evidence = gather_all(model, data, bands)
    start = wls(model, start_evidence)
    scene = _scene(model, start.value, data, bands)
    everything = [Candidate(effect, member) for effect in catalogue for member in effect.members(scene)]
    candidates = [item for item in everything if item.label(scene) not in without]
    tried = max(1, len(candidates))
    progress(f"making the columns of {len(candidates)} candidates")
    base = tabulate(model, data, bands)
    columns, places = tabulate_candidates(scene, candidates, data, bands)
    chosen: list[Candidate] = []
    steps: list[Step] = []
    delay: tuple[float, float] | None = None
    weights, estimate = start.weights, start
    while True:
        progress(f"trying {len(candidates)} candidates" + (f" beside {len(chosen)} found" if chosen else ""))
        own, _ = tabulate_candidates(scene, chosen, data, bands)
        beside = Beside(scene, data, tuple(bands), base.beside(own), weights, tried)
        decisions = beside.judge(candidates, columns, places)
        fitted = model_with(scene, chosen)
        seeds = line_candidates(scene, fitted, estimate.value, data, bands, catalogue)
        taken = {*without, *(item.label(scene) for item in chosen)}
        decisions += beside.judge_new([item for item in seeds if item.label(scene) not in taken])
        if len(steps) >= MOST_EFFECTS:
            break
        winner = _choose(beside, decisions)
        if winner is None:
            break
        if is_delay(winner.candidate):
            data, delay = _correct_delay(data, winner, delay)
            base = replace(base, torque=tabulate(model, data, bands).torque)
        else:
            chosen.append(winner.candidate)
        done = not is_delay(winner.candidate) or winner.candidate.effect.settled(winner.examination.value)
        if done:
            left = [k for k, item in enumerate(candidates) if item.label(scene) != winner.label]
            candidates, places = [candidates[k] for k in left], tuple(places[k] for k in left)
        scene, chosen = tune(scene, data, bands, base, weights, chosen)
        fitted = model_with(scene, chosen)
        evidence = gather_all(fitted, data, bands)
        estimate = wls(fitted, evidence)
        weights = estimate.weights
        scene = replace(scene, value=estimate.value[: len(model.columns)])
        repeated = bool(steps) and steps[-1].decision.label == winner.label
        steps[len(steps) - repeated :] = [Step(winner, evidence, estimate)]
    kept = _backward(scene, data, bands, base, weights, chosen, tried)
    scene, kept = tune(scene, data, bands, base, weights, kept)
    labels = {item.label(scene) for item in kept}
    steps = [step for step in steps if step.decision.label in labels or is_delay(step.decision.candidate)]
    return Search(
        model, scene, tuple(bands), start, start_evidence, tuple(steps), tuple(kept), delay,
        tuple(decisions), tried, data,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Beside:
    """The model that candidates are tried beside: its rows, and what judging needs.

    Attributes
    ----------
    scene : Scene
    recordings : tuple of Recording
    bands : tuple of float or None
    table : Table
        Columns of the model and of the effects in it.
    weights : ndarray, shape (n,)
    tried : int
        Candidates and scan points tried.
    """

    scene: Scene
    recordings: tuple[Recording, ...]
    bands: tuple[float | None, ...]
    table: Table
    weights: Array
    tried: int

    def judge(self, candidates: Sequence[Candidate], columns: Array, places: Sequence[slice]) -> list[Decision]:
        """Examine candidates whose columns are at hand, and decide on each."""
        if not candidates:
            return []
        count = self.table.columns.shape[1]
        rows = self.table.beside(columns).weighted(self.weights)
        groups = [list(range(count + place.start, count + place.stop)) for place in places]
        found = examine(rows, range(count), groups)
        return [decide(item, result, self.scene, self.tried) for item, result in zip(candidates, found, strict=True)]

    def judge_new(self, candidates: Sequence[Candidate]) -> list[Decision]:
        """Make the columns of candidates and judge them."""
        if not candidates:
            return []
        return self.judge(candidates, *tabulate_candidates(self.scene, candidates, self.recordings, self.bands))


def is_delay(candidate: Candidate) -> bool:
    """Whether a candidate is corrected in the data, as the delay of all joints is."""
    return candidate.effect.corrects_data(candidate.member)


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


def best_of_each(decisions: Sequence[Decision]) -> dict[str, Decision]:
    """Return the best scan point of every family and joint, acceptable ones first."""
    best: dict[str, Decision] = {}
    for decision in decisions:
        held = best.get(decision.label)
        if held is None or (decision.accepted, decision.gain) > (held.accepted, held.gain):
            best[decision.label] = decision
    return best


def _choose(beside: Beside, decisions: Sequence[Decision]) -> Decision | None:
    """Refine the best families and return the best acceptable member of them that is told from zero."""
    accepted = [item for item in best_of_each(decisions).values() if item.accepted]
    accepted.sort(key=lambda item: -item.examination.held_out)
    if not accepted:
        return None
    enough = NEAR_BEST * accepted[0].examination.held_out
    leaders = [item for item in accepted if item.examination.held_out >= enough][:MOST_REFINED]
    sound = sorted(
        (item for item in refine(beside, leaders) if item.accepted), key=lambda item: -item.examination.held_out
    )
    return next((item for item in sound if _told_from_zero(beside, item.candidate)), None)


def _told_from_zero(beside: Beside, candidate: Candidate) -> bool:
    """Whether an effect has a size beyond its uncertainty, that of its nonlinear parameters included."""
    if not candidate.effect.nonlinear:
        return True
    nonlinear = {parameter.name for parameter in candidate.effect.nonlinear}
    found = parameters_beside(beside.scene, beside.recordings, beside.bands, beside.table, beside.weights, candidate)
    sizes = [parameter for name, parameter in found.items() if name not in nonlinear and name != "phase"]
    return any(abs(parameter.value) > TOLD * parameter.std for parameter in sizes)


def refine(beside: Beside, leaders: Sequence[Decision]) -> list[Decision]:
    """Refine the nonlinear parameters of several candidates on lines that narrow about the best point so far."""
    current = list(leaders)
    for round_ in range(LINE_ROUNDS):
        variants = [
            (place, item) for place, held in enumerate(current) for item in _line(beside.scene, held.candidate, round_)
        ]
        found = beside.judge_new([item for _, item in variants])
        for (place, _), decision in zip(variants, found, strict=True):
            held = current[place]
            if decision.examination.gain > held.examination.gain and (decision.accepted or not held.accepted):
                current[place] = decision
    return current


def _line(scene: Scene, candidate: Candidate, round_: int) -> list[Candidate]:
    """Return variants of a candidate on a line for each nonlinear parameter, a third as long every round."""
    variants = []
    for k, parameter in enumerate(candidate.effect.nonlinear):
        value = candidate.member.nonlinear[k]
        reach = _spacing(scene, candidate, k) * (2.0 / (LINE_POINTS - 1)) ** round_
        offsets = np.linspace(-reach, reach, LINE_POINTS)
        points = value * np.exp(offsets) if parameter.logarithmic else value + offsets
        for point in points:
            if abs(point - value) > 1e-12 * abs(value) and parameter.lower <= point <= parameter.upper:
                nonlinear = list(candidate.member.nonlinear)
                nonlinear[k] = float(point)
                variants.append(candidate.at(nonlinear))
    return variants


def _spacing(scene: Scene, candidate: Candidate, k: int) -> float:
    """Distance to the next scan point of a nonlinear parameter, in its logarithm where it is scanned so.

    A family that knows how far apart values must be to be told apart says so by ``resolution``.
    """
    parameter = candidate.effect.nonlinear[k]
    widths = candidate.effect.resolution(scene, candidate.member)
    if widths is not None:
        return widths[k] / candidate.member.nonlinear[k] if parameter.logarithmic else widths[k]
    grid = np.array(sorted({member.nonlinear[k] for member in candidate.effect.members(scene)}))
    if parameter.logarithmic:
        return float(np.min(np.diff(np.log(grid)))) if len(grid) > 1 else float(np.log(2.0))
    return float(np.min(np.diff(grid))) if len(grid) > 1 else 0.1 * (parameter.upper - parameter.lower)


def _correct_delay(
    recordings: Sequence[Recording], decision: Decision, delay: tuple[float, float] | None
) -> tuple[tuple[Recording, ...], tuple[float, float]]:
    """Shift the effort of all recordings by the delay found."""
    step = float(decision.examination.value[0])
    std = float(np.sqrt(decision.examination.covariance[0, 0]))
    total = step + (delay[0] if delay else 0.0)
    effect, member, value = decision.candidate.effect, decision.candidate.member, decision.examination.value
    return tuple(effect.corrected(recording, member, value) for recording in recordings), (total, std)


def _backward(
    scene: Scene,
    recordings: Sequence[Recording],
    bands: Sequence[float | None],
    base: Table,
    weights: Array,
    chosen: Sequence[Candidate],
    tried: int,
) -> list[Candidate]:
    """Drop, one at a time, effects that the others have made superfluous."""
    kept = list(chosen)
    while len(kept) > 1:
        columns, places = tabulate_candidates(scene, kept, recordings, bands)
        decisions = []
        for k, item in enumerate(kept):
            rest = np.hstack([columns[:, place] for i, place in enumerate(places) if i != k])
            beside = Beside(scene, tuple(recordings), tuple(bands), base.beside(rest), weights, tried)
            own = columns[:, places[k]]
            decisions += beside.judge([item], own, [slice(0, own.shape[1])])
        weakest = min(range(len(kept)), key=lambda k: decisions[k].gain)
        if decisions[weakest].accepted:
            break
        kept.pop(weakest)
    return kept
