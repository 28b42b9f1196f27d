"""What experiment to do next: what would tell effects apart, or show one that the recordings cannot."""

from __future__ import annotations

import numpy as np

from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.report.diagnosis import best_by_label

# Candidates of which more could be said with other recordings, at the most.
MOST = 4
MOST_LABELS = 3


def next_experiments(diagnosis: Diagnosis) -> list[str]:
    """Return in words what to record next, the most useful first."""
    search = diagnosis.search
    decisions_taken = (*search.decisions, *(step.decision for step in search.steps))
    experiment = {item.candidate.effect.name: item.candidate.effect.experiment for item in decisions_taken}
    found = []
    if diagnosis.unexplained is not None:
        remainder = diagnosis.unexplained
        if remainder.signals:
            signals = " and ".join(remainder.signals)
            found.append(
                f"To learn what is left on {remainder.joint}: move slowly over the whole range of {signals}, all else as constant "
                "as can be, in both directions and at two speeds; then with a payload."
            )
        else:
            found.append(f"To learn what is left on {remainder.joint}: repeat one trajectory at half the speed; how the remainder scales tells friction from inertia and from delays.")  # fmt: skip
    for effect in diagnosis.effects:
        if effect.confounded_with:
            others = ", ".join(dict.fromkeys(confounder.label for confounder in effect.confounded_with))
            found.append(f"To tell {_label(effect.effect, effect.joint)} from {others}: {experiment[effect.effect]}.")
    if not diagnosis.fit_after:
        found.append("To know the noise floor: record every trajectory at least twice.")
    if not diagnosis.validation_before.data.recordings:
        found.append(
            "To trust the result: record a trajectory that takes no part in the diagnosis and give it with --validate."
        )
    hidden, faint = [], []
    for decision in best_by_label(diagnosis.search.decisions):
        if decision.accepted:
            continue
        if decision.examination.outside < search.step.criteria.least_outside:
            hidden.append(decision)
        elif decision.gain > 0.0 and _significant(decision, diagnosis) and _possible(decision, diagnosis):
            faint.append(decision)
    told = {effect.effect for effect in diagnosis.effects if effect.confounded_with}
    confirm: dict[str, list[str]] = {}
    for effect in diagnosis.effects:
        if effect.effect not in told:
            confirm.setdefault(effect.effect, []).append(_label(effect.effect, effect.joint))
    found += [f"To confirm {' and '.join(labels)}: {experiment[name]}." for name, labels in confirm.items()]
    for words, decisions in (
        ("To judge {}, significant but not accepted ({})", faint),
        ("To see {} at all, which these recordings cannot show", hidden),
    ):
        # One experiment serves all joints.
        by_effect: dict[str, list[Decision]] = {}
        for decision in decisions:
            by_effect.setdefault(decision.candidate.effect.name, []).append(decision)
        for name, members in list(by_effect.items())[:MOST]:
            labels = " and ".join(member.label for member in members[:MOST_LABELS])
            labels += f" and {len(members) - MOST_LABELS} more" if len(members) > MOST_LABELS else ""
            found.append(f"{words.format(labels, members[0].why)}: {experiment[name]}.")
    return found


def _significant(decision: Decision, diagnosis: Diagnosis) -> bool:
    # Of what is negligible, such as a delay within a sample's period, no motion of the arm tells more.
    effect, member, scene = decision.candidate.effect, decision.candidate.member, diagnosis.search.scene
    if not effect.corrects_data(member) and effect.negligible(scene, member, decision.examination.value) is not None:
        return False
    return decision.examination.p_value * diagnosis.search.tried < diagnosis.search.step.criteria.family_error


def _possible(decision: Decision, diagnosis: Diagnosis) -> bool:
    """Whether a real arm can have the coefficients found."""
    examination, candidate = decision.examination, decision.candidate
    std = np.sqrt(np.clip(np.diag(examination.covariance), 0.0, None))
    return candidate.effect.inadmissible(diagnosis.search.scene, candidate.member, examination.value, std) is None


def _label(effect: str, joint: str | None) -> str:
    return effect if joint is None else f"{effect} of {joint}"
