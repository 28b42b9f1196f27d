"""What to do next: the open questions, each with the motion or the experiment that answers it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from scara_ident.calling import asked_for
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.selection.tentative import settled_by
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import best_of_each
from scara_ident.inquiry.answerability import inquire
from scara_ident.inquiry.questions import HALF_THE_SPEED, Question, possible, questions
from scara_ident.manners import listed
from scara_ident.threads import one_blas_thread

# A motion that is designed to tell, s, and how that is asked for.
ASKED_SECONDS, ASKED_MOTION = 15.0, "excite --tell"
# Kinds of questions whose motions come before recordings of another kind.
URGENT = ("confounders", "unexplained")
# Effects of which more could be said, and joints that are named of each.
MAX_EFFECTS, MAX_LABELS = 4, 3
# By diagnosis: its file, its report and its story in words all hold them, and they take all its recordings.
_FOUND: WeakKeyDictionary[Diagnosis, tuple[NextStep, ...]] = WeakKeyDictionary()


@dataclass(frozen=True)
class NextStep:
    """Something to do.

    Attributes
    ----------
    motion : str
        ``excite --tell``, or an experiment in words.
    seconds : float or None
        Of arm time; None where the experiment decides.
    sigma_before : float or None
        Standard errors between the answers by the recordings at hand; None where they were not computed.
    asked : Question or None
        For a motion that is designed.
    """

    question: str
    motion: str
    seconds: float | None = None
    sigma_before: float | None = None
    asked: Question | None = None

    def entry(self) -> dict[str, Any]:
        """Return it as plain values."""
        found = {
            "question": self.question,
            "motion": self.motion,
            "sigma_before": self.sigma_before,
            # Of the motion, which `ask` designs and then says.
            "sigma_after": None,
            "seconds": self.seconds,
        }
        return found if self.asked is None else {**self.asked.entry(), **found}

    def sentence(self) -> str:
        """Say it for a person."""
        return capital(self.within())

    def within(self) -> str:
        """Say it after a colon."""
        said = f"{self.question}: "
        if self.asked is None:
            return f"{said}{self.motion}{'' if self.seconds is None else f' ({self.seconds:.0f} s)'}."
        now = "" if self.sigma_before is None else f"; {self.sigma_before:.2g} standard errors apart so far"
        return f"{said}{self.motion} designs a motion ({self.seconds:.0f} s){now}; by hand: {self.asked.experiment}."


def next_steps(diagnosis: Diagnosis) -> tuple[NextStep, ...]:
    """Return what to do next, the most useful first: motions, then recordings of another kind, then experiments."""
    found = _FOUND.get(diagnosis)
    if found is None:
        found = _FOUND[diagnosis] = _steps(diagnosis)
    return found


@one_blas_thread()
def _steps(diagnosis: Diagnosis) -> tuple[NextStep, ...]:
    found = questions(diagnosis)
    # Columns are made of what is asked, and what these needed is not held beside.
    diagnosis.search.step.lean()
    urgent = [item for item in found if item.kind in URGENT]
    asked = [*urgent, *(item for item in found if item not in urgent)]
    sigmas = inquire(diagnosis, asked).sigmas()
    motions = [
        NextStep(question.text, ASKED_MOTION, ASKED_SECONDS, float(sigma), question)
        for question, sigma in zip(asked, sigmas, strict=True)
    ]
    steps = (
        *motions[: len(urgent)],
        *_remainder(diagnosis, urgent),
        *_apart(diagnosis),
        *_recordings(diagnosis),
        *motions[len(urgent) :],
        *_confirmations(diagnosis),
        *_faint(diagnosis),
        *(
            NextStep(
                f"{item.effect} or what absorbs it ({', '.join(item.absorbed_by)})"
                if item.absorbed_by
                else f"{item.effect}, which changes no torque",
                item.opened_by,
            )
            for item in diagnosis.aliases
        ),
    )
    diagnosis.search.step.lean()
    return steps


def _remainder(diagnosis: Diagnosis, asked: Sequence[Question]) -> Iterator[NextStep]:
    """Say what tells a remainder over which no motion can be spread."""
    if any(item.kind == "unexplained" for item in asked):
        return
    if diagnosis.unexplained is not None:
        joints = [diagnosis.unexplained.joint]
    else:
        joints = [item.joint for item in diagnosis.evidence if not item.shown and item.by == "repetition"]
    if joints:
        yield NextStep(f"what is left on {' and '.join(joints)}", HALF_THE_SPEED, 2.0 * diagnosis.search.scene.duration)


def _apart(diagnosis: Diagnosis) -> Iterator[NextStep]:
    """Ask for a recording that leaves more than all others once more, unless a repetition of its motion is there already."""
    training = diagnosis.training_after
    names, motions = [item.name for item in training.each], list(training.data.labels)
    joints: dict[str, list[str]] = {}
    for item in diagnosis.evidence:
        if item.apart in names:
            joints.setdefault(item.apart, []).append(item.joint)
    for name, own in joints.items():
        place = names.index(name)
        length = sum(part.samples / part.rate for part in training.data.stretches if part.name == name)
        again = (
            f"record its motion again: if the difference is gone, something was different in {name}; then leave that recording out",
            length,
        )
        there = (
            f"other recordings of the same motion do not have it: find what was different in {name}, or leave that recording out",
            None,
        )
        motion, seconds = there if motions.count(motions[place]) > 1 else again
        yield NextStep(f"what only {name} has on {' and '.join(own)}", motion, seconds)


def _recordings(diagnosis: Diagnosis) -> Iterator[NextStep]:
    length = sum(part.samples / part.rate for part in diagnosis.training_after.data.stretches)
    if not diagnosis.fit_after:
        yield NextStep("the noise floor", "record every trajectory at least twice", length)
    if not diagnosis.validation_before.data.recordings:
        longest = diagnosis.search.scene.duration
        yield NextStep(
            "whether the result holds elsewhere",
            f"record another trajectory for validation only, and give it with {asked_for('--validate', 'validation')}",
            longest,
        )
    speeds = "record the same path at another speed, to distinguish a delay from what depends on speed"
    correction = diagnosis.search.correction
    # Of what is less than a sample no motion tells more.
    if correction is not None and correction.negligible(diagnosis.search.scene) is None:
        yield NextStep("the delay that was corrected", speeds, diagnosis.search.scene.duration)


def _confirmations(diagnosis: Diagnosis) -> Iterator[NextStep]:
    """Ask for the experiment that brings an effect out, one for all of its joints."""
    confounded = {effect.effect for effect in diagnosis.effects if any(item.value for item in effect.confounded_with)}
    confirm: dict[str, list[str]] = {}
    experiment = {item.decision.candidate.effect.name: item.decision for item in diagnosis.search.steps}
    for effect in diagnosis.effects:
        if effect.effect not in confounded:
            confirm.setdefault(effect.effect, []).append(effect.label)
    for name, labels in confirm.items():
        yield NextStep(f"to confirm {' and '.join(labels)}", experiment[name].candidate.effect.experiment)


def _faint(diagnosis: Diagnosis) -> Iterator[NextStep]:
    """Ask for the experiments that show what these recordings hardly or never do, one for all joints of an effect."""
    criteria = diagnosis.search.step.criteria
    faint: dict[str, list[Decision]] = {}
    hidden: dict[str, list[Decision]] = {}
    for decision in sorted(best_of_each(diagnosis.search.decisions).values(), key=lambda item: -item.gain):
        if decision.accepted:
            continue
        name = decision.candidate.effect.name
        if decision.examination.outside < criteria.min_outside:
            hidden.setdefault(name, []).append(decision)
        elif decision.gain > 0.0 and _significant(decision, diagnosis) and possible(decision, diagnosis):
            faint.setdefault(name, []).append(decision)
    for members in list(faint.values())[:MAX_EFFECTS]:
        yield NextStep(f"to judge {with_reasons(members)}", settled_by(diagnosis.search, members[:MAX_LABELS]))
    for members in list(hidden.values())[:MAX_EFFECTS]:
        labels = listed([member.label for member in members], MAX_LABELS, " and ")
        said = f"to see {labels}, which these recordings cannot show at all"
        yield NextStep(said, members[0].candidate.effect.experiment)


def with_reasons(members: Sequence[Decision]) -> str:
    """Name candidates that are significant and not accepted, with the reason of all or each with its own."""
    said = "significant but not accepted"
    if len({member.why for member in members[:MAX_LABELS]}) == 1:
        return f"{listed([member.label for member in members], MAX_LABELS, ' and ')}, {said} ({members[0].why})"
    return f"{listed([f'{member.label} ({member.why})' for member in members], MAX_LABELS, ' and ')}, {said}"


def _significant(decision: Decision, diagnosis: Diagnosis) -> bool:
    # Of what is negligible, such as a delay within a sample's period, no motion of the arm tells more.
    effect, member, scene = decision.candidate.effect, decision.candidate.member, diagnosis.search.scene
    if not effect.corrects_data(member) and effect.negligible(scene, member, decision.examination.value) is not None:
        return False
    return decision.examination.p_value * diagnosis.search.tried < diagnosis.search.step.criteria.family_error


def capital(words: str) -> str:
    """Begin a sentence with a capital, unless it begins with a name, such as that of a joint or a link."""
    first = words.partition(" ")[0]
    return words if any(sign in first for sign in "_0123456789") else words[:1].upper() + words[1:]
