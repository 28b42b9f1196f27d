"""What a diagnosis left open, as questions that a motion of the arm may answer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from itertools import chain
from typing import Any, Literal

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.noise_check import less_noise
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.candidate_tests import Examination
from scara_ident.diagnosis.testing.cluster_test import needed
from scara_ident.effects import EFFECTS, Effect, Interval, Member
from scara_ident.errors import ScaraIdentError
from scara_ident.inquiry.shape import shape_over
from scara_ident.manners import listed

Kind = Literal["confounders", "unexplained", "below_limit", "parameter"]
# Confounders of one effect, and candidates that these recordings would hardly have shown: of each family, in all, and by name.
MAX_CONFOUNDERS, MAX_PER_FAMILY, MAX_BELOW_LIMIT, MAX_NAMED = 4, 2, 24, 3
# Of one suspect against another, at most.
MAX_ODDS = 100.0
# What tells a remainder that no signal of the motion is known to make.
HALF_THE_SPEED = "repeat one trajectory at half the speed; the scaling of the remainder distinguishes friction from inertia and from delays"
# Parameters asked for, and the standard deviation over the size that makes one unsure.
MAX_PARAMETERS, UNSURE_SHARE = 3, 0.3


@dataclass(frozen=True)
class Suspect:
    """An effect as it may be.

    Attributes
    ----------
    candidate : Candidate
    label : str
        Effect and joint.
    value : tuple of float
        Its coefficients.
    odds : float
        How much likelier the recordings make it than one that they say nothing of, see `odds_of`.
    """

    candidate: Candidate
    label: str
    value: tuple[float, ...]
    odds: float = 1.0

    def entry(self) -> dict[str, Any]:
        """Return it as plain values; see `suspect_of`."""
        effect, member = self.candidate.effect, self.candidate.member
        return {
            "effect": effect.name,
            "variant": _variant(effect),
            "options": _numbers(effect),
            "label": self.label,
            "place": member.joint,
            "partner": member.partner,
            "nonlinear": list(member.nonlinear),
            "intervals": [list(astuple(item)) for item in member.intervals],
            "value": list(self.value),
            "odds": self.odds,
        }


@dataclass(frozen=True)
class Question:
    """Something that recordings left open.

    Attributes
    ----------
    kind : {"confounders", "unexplained", "below_limit", "parameter"}
        Which of some effects it is; what a remainder looks like; whether effects of a size are there; how large a
        parameter is.
    text : str
        For a person.
    suspects : tuple of Suspect
        The effects in question; of confounders the first is the one in the model.
    joint : str or None
        Whose remainder it is.
    signals : tuple of str
        What that depends on.
    parameter : str or None
    size : float
        Rms of the remainder, or size of the parameter.
    experiment : str
        What to do where no motion of the arm answers it.
    sigma : float
        Standard errors between the answers that a diagnosis says, for where its recordings are not at hand.
    """

    kind: Kind
    text: str
    suspects: tuple[Suspect, ...] = ()
    joint: str | None = None
    signals: tuple[str, ...] = ()
    parameter: str | None = None
    size: float = np.nan
    experiment: str = ""
    sigma: float = 0.0

    def entry(self) -> dict[str, Any]:
        """Return it as plain values; see `question_of`."""
        return {
            "question": self.text,
            "kind": self.kind,
            "suspects": [item.entry() for item in self.suspects],
            "joint": self.joint,
            "signals": list(self.signals),
            "parameter": self.parameter,
            "size": self.size,
            "experiment": self.experiment,
        }


def question_of(entry: Mapping[str, Any]) -> Question:
    """Return a question from its entry in a ``diagnosis.json``.

    Raises
    ------
    ScaraIdentError
        If it names an effect that is not installed.
    """
    return Question(
        entry["kind"],
        str(entry["question"]),
        tuple(suspect_of(item) for item in entry["suspects"]),
        entry["joint"],
        tuple(entry["signals"]),
        entry["parameter"],
        np.nan if entry["size"] is None else float(entry["size"]),
        str(entry["experiment"]),
        float(entry.get("sigma_before") or 0.0),
    )


def suspect_of(entry: Mapping[str, Any]) -> Suspect:
    """Return a suspect from its entry.

    Raises
    ------
    ScaraIdentError
        If the effect is not installed.
    """
    families = EFFECTS.get(entry["effect"])
    if not 0 <= entry["variant"] < len(families):
        raise ScaraIdentError(f"effect {entry['effect']}: not the one that the diagnosis had; diagnose again")
    nonlinear, value = (tuple(float(x) for x in entry[key]) for key in ("nonlinear", "value"))
    intervals = tuple(Interval(*item) for item in entry.get("intervals", ()))
    member = Member(entry["place"], nonlinear, entry["partner"], intervals)
    # Results of earlier versions have no options.
    family = replace(families[entry["variant"]], **entry.get("options", {}))
    candidate = Candidate(family, member)
    return Suspect(candidate, str(entry["label"]), value, float(entry.get("odds", 1.0)))


def _variant(effect: Effect) -> int:
    families = EFFECTS.get(effect.name) if effect.name in EFFECTS.names() else ()
    alike = [k for k, family in enumerate(families) if type(family) is type(effect)]
    return next((k for k in alike if families[k] == effect), alike[0] if alike else -1)


def _numbers(effect: Effect) -> dict[str, float]:
    """Return the options of a family that are numbers, as the delay that a correction had."""
    options = {item.name: getattr(effect, item.name) for item in fields(effect)}
    return {name: value for name, value in options.items() if type(value) in (int, float)}


def questions(diagnosis: Diagnosis) -> tuple[Question, ...]:
    """Return what a diagnosis left open and a motion may answer, the most valuable first.

    Parameters
    ----------
    diagnosis : Diagnosis

    Notes
    -----
    First effects that were found and may be another, then a remainder, then effects that are worth a look, then what these
    recordings would have shown least of, and last parameters that are hardly known.
    """
    found = [*_confounders(diagnosis), *_remainder(diagnosis), *_worth_a_look(diagnosis)]
    asked = {item.label for question in found for item in question.suspects}
    return tuple([*found, *_below_limit(diagnosis, asked), *_parameters(diagnosis)])


def suspects_in_model(diagnosis: Diagnosis) -> tuple[Suspect, ...]:
    """Return the effects in the model with their coefficients, in its order."""
    search = diagnosis.search
    start = len(search.base.columns)
    result = []
    for candidate in search.chosen:
        stop = start + len(candidate.effect.columns(search.scene, candidate.member))
        value = tuple(float(x) for x in diagnosis.after.value[start:stop])
        result.append(Suspect(candidate, candidate.label(search.scene), value))
        start = stop
    return tuple(result)


def _confounders(diagnosis: Diagnosis) -> Iterator[Question]:
    own = {item.candidate: item for item in suspects_in_model(diagnosis)}
    asked: set[frozenset[str]] = set()
    for effect in sorted(diagnosis.effects, key=lambda item: -item.gain):
        if effect.candidate not in own or effect.candidate is None:
            continue
        first = own[effect.candidate]
        others = [item for item in effect.confounded_with if item.value and _moves(item.candidate)][:MAX_CONFOUNDERS]
        suspects = (first, *(Suspect(item.candidate, item.label, item.value) for item in others))
        labels = frozenset(item.label for item in suspects)
        if others and _moves(first.candidate) and labels not in asked:
            asked.add(labels)
            text = " or ".join(item.label for item in suspects)
            yield Question("confounders", text, suspects, experiment=first.candidate.effect.experiment)


def _remainder(diagnosis: Diagnosis) -> Iterator[Question]:
    left = diagnosis.unexplained
    if left is None:
        return
    signals = left.signals
    if not diagnosis.dependences:
        # One trajectory cannot say what it depends on: another spreads over the state of its joint.
        signals = signals or (f"position of {left.joint}", f"velocity of {left.joint}")
    if shape_over(diagnosis.robot, signals, diagnosis.robot.joints.index(left.joint)) is not None:
        text = f"what is left on {left.joint}, over {' and '.join(signals)}"
        yield Question("unexplained", text, joint=left.joint, signals=signals, size=left.rms, experiment=HALF_THE_SPEED)


def _worth_a_look(diagnosis: Diagnosis) -> Iterator[Question]:
    step = diagnosis.search.step
    known = {item.label(step.scene) for item in step.chosen}
    found = [item.decision for item in diagnosis.tentative if item.decision is not None]
    for before, decision in zip(found, less_noise(step, found), strict=True):
        suspect = _as_found(decision)
        if decision is not before and decision.examination.p_value > step.criteria.significant:
            # What the noise leaves of it is one of many that may be below the limit.
            continue
        if _moves(decision.candidate) and decision.label not in known and np.any(suspect.value):
            known.add(decision.label)
            experiment = decision.candidate.effect.experiment
            yield Question("below_limit", f"{decision.label} or none", (suspect,), experiment=experiment)


def _below_limit(diagnosis: Diagnosis, asked: set[str]) -> Iterator[Question]:
    """Ask for what is likeliest and for what would have shown least, each of a size that would just have shown."""
    seen: dict[str, int] = {}
    suspects = []
    for decision in sorted(_others(diagnosis), key=lambda item: (-_odds(item), item.examination.outside)):
        name = decision.candidate.effect.name
        limit, errors = _limit(decision.examination, diagnosis), _errors(decision.examination)
        if decision.label in asked or not np.isfinite(limit) or errors == 0.0 or seen.get(name, 0) >= MAX_PER_FAMILY:
            continue
        seen[name] = seen.get(name, 0) + 1
        value = limit / errors * decision.examination.value
        suspects.append(Suspect(decision.candidate, decision.label, tuple(float(x) for x in value), _odds(decision)))
    if suspects:
        chosen = tuple(suspects[:MAX_BELOW_LIMIT])
        text = f"effects that these recordings hardly excite: {listed([item.label for item in chosen], MAX_NAMED)}"
        yield Question("below_limit", text, chosen, experiment="record another motion over the whole workspace")


def _parameters(diagnosis: Diagnosis) -> Iterator[Question]:
    from scara_ident.model.terms import RigidBody

    model, after = diagnosis.before.model, diagnosis.after
    nominal = np.zeros(len(model.columns))
    body: RigidBody = model.rigid_body
    nominal[model.place(body)] = (body.base.grouping @ model.robot.standard_parameters())[body.kept]
    size = np.maximum(np.abs(after.value[: len(nominal)]), np.abs(nominal))
    share = np.divide(after.std[: len(size)], size, out=np.zeros(len(size)), where=nominal != 0.0)
    for k in np.argsort(-share)[:MAX_PARAMETERS]:
        if share[k] > UNSURE_SHARE:
            name = model.columns[k].name
            yield Question("parameter", f"value of {name}", parameter=name, size=float(size[k]),
                           experiment="record another motion over the whole workspace")  # fmt: skip


def _others(diagnosis: Diagnosis) -> list[Decision]:
    """Return of each family and joint not in the model the likeliest member that a motion can show and an arm can have.

    Of members of which nothing is known that which takes the fewest standard errors: what lives in one block of time would
    have to be of a size that no arm has.
    """
    search = diagnosis.search
    known = {item.label(search.scene) for item in search.chosen}
    best: dict[str, tuple[tuple[float, float], Decision]] = {}
    for item in search.decisions:
        open_ = item.label not in known and not item.accepted and not item.candidate.corrects_data
        if not (open_ and _moves(item.candidate) and np.isfinite(item.examination.covariance).all()):
            continue
        own = _of_either_sign(item, diagnosis)
        rank = (_odds(own), -_limit(own.examination, diagnosis))
        if possible(own, diagnosis) and (own.label not in best or rank > best[own.label][0]):
            best[own.label] = rank, own
    found = {label: item for label, (_, item) in best.items()}
    # Where the recordings say nothing for an effect there is nothing for the noise to take off.
    speaking = [item for item in found.values() if _odds(item) > 1.0]
    # By the columns that they were tried with, which are at hand.
    found |= {item.label: item for item in less_noise(search.step, speaking, search.first)}
    signed = (_of_either_sign(item, diagnosis) for item in found.values())
    return [item for item in signed if possible(item, diagnosis)]


def _of_either_sign(decision: Decision, diagnosis: Diagnosis) -> Decision:
    """Return an effect that no arm can have with the other sign, which what is found of nothing has as often.

    It then speaks for no effect.
    """
    if possible(decision, diagnosis):
        return decision
    found = decision.examination
    return replace(decision, examination=replace(found, value=-found.value, p_value=1.0))


def possible(decision: Decision, diagnosis: Diagnosis) -> bool:
    """Return whether a real arm can have the coefficients found."""
    examination, candidate = decision.examination, decision.candidate
    std = np.sqrt(np.clip(np.diag(examination.covariance), 0.0, None))
    return candidate.effect.inadmissible(diagnosis.search.scene, candidate.member, examination.value, std) is None


def _moves(candidate: Candidate) -> bool:
    """Whether what the arm does decides how large it shows, not which recording it is."""
    return not (candidate.effect.by_recording or candidate.effect.in_intervals) and _variant(candidate.effect) >= 0


def _as_found(decision: Decision) -> Suspect:
    value = tuple(float(x) for x in decision.examination.value)
    return Suspect(decision.candidate, decision.label, value, _odds(decision))


def _odds(decision: Decision) -> float:
    return odds_of(decision.examination.p_value)


def odds_of(p_value: float) -> float:
    """Return the most that a p-value speaks for an effect and against none, ``-1 / (e p ln p)``.

    Sellke, Bayarri and Berger, "Calibration of p values for testing precise null hypotheses", The American Statistician
    55(1), 2001; where it says nothing 1, and at most `MAX_ODDS`, so that none is forgotten for what may be another's.
    """
    p = min(float(p_value), np.exp(-1.0))
    return MAX_ODDS if p <= 0.0 else float(min(MAX_ODDS, -1.0 / (np.e * p * np.log(p))))


def _errors(found: Examination) -> float:
    """Return by how many standard errors coefficients differ from none."""
    if not np.all(np.isfinite(found.covariance)):
        return 0.0
    wald = found.tested @ np.linalg.pinv(found.covariance, rcond=1e-9, hermitian=True) @ found.tested
    return float(np.sqrt(max(float(wald), 0.0)))


def _limit(found: Examination, diagnosis: Diagnosis) -> float:
    """Return the standard errors that coefficients would have to have to be significant."""
    chance = diagnosis.search.step.criteria.family_error / diagnosis.search.tried
    return needed(len(found.value), found.freedom, chance) if np.isfinite(found.freedom) else np.inf


def all_suspects(asked: Sequence[Question]) -> tuple[Suspect, ...]:
    """Return the suspects of all questions, each once."""
    return tuple(dict.fromkeys(chain.from_iterable(item.suspects for item in asked)))
