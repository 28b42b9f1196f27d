"""A diagnosis in sentences, the most important first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.calling import asked_for
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.outcome import Unexplained
from scara_ident.diagnosis.fitting.effect_parameters import RotorInertia
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.held_out.gain import shown_of, words_of
from scara_ident.effects import Parameter
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.estimation.urdf_weight import scale_in_words
from scara_ident.inquiry.next_steps import next_steps
from scara_ident.model.terms.friction import Friction
from scara_ident.report.doubts import doubts
from scara_ident.report.identification import bias_said
from scara_ident.report.moved import away_from_urdf
from scara_ident.robot.rotors import GUESS_FACTOR

# An uncertainty below this factor is written as a standard deviation.
NEAR_FACTOR = 1.3
# Two values differ from so many of their common standard deviations: 0.3 %.
DIFFERENT_STDS = 3.0
# An error is said to be worse from so many times on: less may be chance.
WORSE_RATIO = 1.2


def sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the result in words, what questions it first."""
    first, others = headline_and_details(diagnosis)
    return (*first, *others)


def headline_and_details(diagnosis: Diagnosis) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the sentences that stand before all else, see `scara_ident.report.doubts`, and all others."""
    after, held = diagnosis.after, diagnosis.training_after
    scale = scale_in_words(after, held)
    first = doubts(after, held, diagnosis.training_before, scale)
    return first, (*_others(diagnosis), *([] if scale in first else [scale]))


def _others(diagnosis: Diagnosis) -> list[str]:
    found = _headline(diagnosis)
    for effect in diagnosis.effects:
        found += _found(effect, diagnosis)
        found += [_directly(name, parameter, effect.parameters[name]) for name, parameter in effect.direct.items()]
        if effect.confounded_with:
            others = ", ".join(effect.confounder_names(diagnosis.search.scene))
            found.append(f"These recordings cannot distinguish it from: {others}.")
    if diagnosis.verdict == "undecided":
        found += [*_to_do_first(diagnosis), *_not_shown(diagnosis.evidence)]
    elif diagnosis.unexplained is not None:
        found += _not_shown(
            [item for item in diagnosis.evidence if item.lacks and item.joint != diagnosis.unexplained.joint]
        )
    if diagnosis.effects:
        found += _errors(diagnosis)
        away = away_from_urdf(diagnosis)
        found += [] if away is None else [away]
    for guess in diagnosis.tentative:
        where = f" on {guess.joint}" if guess.joint else ""
        gain = f"would remove {max(guess.gain, 0.0):.0%} of the squared residual"
        found.append(
            f"Worth a look, not added: {guess.effect}{where}, {gain}; {guess.why}; to settle it: {guess.settled_by}."
        )
    found += [
        _of_rotor(rotor, diagnosis) for rotor in diagnosis.rotors if not rotor.stated and rotor.factor is not None
    ]
    biased = bias_said(diagnosis.after)
    if biased is not None:
        found.append(biased)
    if not diagnosis.fit_after:
        found.append(
            "No trajectory was repeated, so the noise floor is not known: record each trajectory twice or more."
        )
    return found


def _headline(diagnosis: Diagnosis) -> list[str]:
    """Say the verdict; what was found says of itself that it explains."""
    found = []
    if diagnosis.verdict == "complete":
        found.append("The model lacks nothing that these recordings can show.")
    if diagnosis.verdict == "undecided":
        found.append(_undecided(diagnosis))
    remainder = diagnosis.unexplained
    if remainder is not None:
        unit = diagnosis.robot.torque_unit(diagnosis.robot.joints.index(remainder.joint))
        on = f"depends on {' and '.join(remainder.signals)}" if remainder.signals else "repeats from run to run"
        found.append(
            f"Unexplained: on {remainder.joint} a remainder of {remainder.rms:.3g} {unit} rms {on}; no effect of the "
            f"catalogue explains it{_as_no_arm(diagnosis, remainder)}{_curved(diagnosis, remainder)}."
        )
        if not remainder.signals:
            found += _to_do_first(diagnosis)
    return found


def _to_do_first(diagnosis: Diagnosis) -> list[str]:
    return [f"To do first: {step.within()}" for step in next_steps(diagnosis)[:1]]


def _errors(diagnosis: Diagnosis) -> list[str]:
    """Say what was left before and is left after, on recordings held out if there are any, and where that is worse."""
    kind, old, new = "held-out", diagnosis.validation_before, diagnosis.validation_after
    if not old.data.recordings:
        kind, old, new = "training", diagnosis.training_before, diagnosis.training_after
    before, after = rms_of(diagnosis.before.value, old), rms_of(diagnosis.after.value, new)
    pairs = zip(diagnosis.robot.joints, before, after, strict=True)
    errors = [(joint, a, b) for joint, a, b in pairs if a is not None and b is not None]
    units = {joint: diagnosis.robot.torque_unit(j) for j, joint in enumerate(diagnosis.robot.joints)}
    changes = [f"{joint} {a:.3g} to {b:.3g} {units[joint]}" for joint, a, b in errors]
    found = [f"Rms error on the {kind} recordings: {'; '.join(changes)}."]
    worse = [f"{joint} ({b / a:.2g} times)" for joint, a, b in errors if b > WORSE_RATIO * a > 0.0]
    if worse:
        instead = "there use the model without the effects, or fit more motions"
        found.append(f"Worse with the effects than without them: {', '.join(worse)}; {instead}.")
    return found


def quantity(name: str, parameter: Parameter) -> str:
    """Return a parameter in words, with its standard deviation if it has one, its interval or that nothing determines it."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    interval = parameter.interval
    if interval is not None and np.any(np.isfinite(interval)):
        return f"{name} {_written(parameter.value, 4)}{unit} ({ends(interval)}, 95 %)"
    if interval is not None or not np.isfinite(parameter.std):
        return f"{name} about {parameter.value:.3g}{unit} (not determined by recordings)"
    # What says by which law an effect is has no uncertainty.
    unsure = f" ± {parameter.std:.1g}" if parameter.std else ""
    return f"{name} {parameter.value:.3g}{unsure}{unit}"


def ends(interval: tuple[float, float]) -> str:
    """Return an interval of which one end at least is written in words."""
    low, high = (_written(end, 3) for end in interval)
    if np.all(np.isfinite(interval)):
        return f"{low} to {high}"
    return f"above {low}" if np.isfinite(interval[0]) else f"below {high}"


def _written(value: float, digits: int) -> str:
    """Return a number rounded to so many digits, without an exponent below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"


def _curved(diagnosis: Diagnosis, remainder: Unexplained) -> str:
    """Return the advice to try curved friction where that is what a straight law leaves, else nothing."""
    laws = [term for term in diagnosis.before.model.terms if isinstance(term, Friction)]
    straight = all(max(law.powers) < 2 for law in laws)
    if straight and remainder.signals == (f"velocity of {remainder.joint}",):
        return f"; the model's friction is linear in speed: try {asked_for('--model complete')}"
    return ""


def _as_no_arm(diagnosis: Diagnosis, remainder: Unexplained) -> str:
    """Return which effect goes as the remainder does, with coefficients that no arm has, if one does; else nothing."""
    found = diagnosis.search
    like = [
        item
        for item in found.decisions
        if item.as_no_arm >= found.step.criteria.nearly_all and item.candidate.joint(found.scene) == remainder.joint
    ]
    if not like:
        return ""
    best = max(like, key=lambda item: item.as_no_arm)
    return f"; it looks like {best.label}, which removes {best.as_no_arm:.0%} of the squared residual there, but {best.why}"


def _undecided(diagnosis: Diagnosis) -> str:
    """Say whether it is open that something is missing, or only what it is."""
    lacking = [item.joint for item in diagnosis.evidence if item.lacks]
    more = "something else is missing too" if diagnosis.effects else "something is missing"
    if lacking:
        return f"Undecided: {more} on {' and '.join(lacking)}, but these recordings cannot show what it is."
    return f"Undecided: these recordings cannot show whether {more}."


def _not_shown(evidence: Sequence[Evidence]) -> list[str]:
    """Say why what is left was not shown to be noise, joints with the same reason together."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for item in evidence:
        if not item.shown:
            share, percent, reason = item.why.partition("% ")
            alike = percent and share.isdigit()
            groups.setdefault(reason if alike else item.why, []).append((item.joint, share if alike else ""))
    found = []
    for why, members in groups.items():
        shares = sorted({int(share) for _, share in members if share})
        size = " to ".join(f"{share}%" for share in dict.fromkeys((shares[0], shares[-1]))) + " " if shares else ""
        found.append(f"On {', '.join(joint for joint, _ in members)}: {size}{why}.")
    return found


def _found(effect: FoundEffect, diagnosis: Diagnosis) -> list[str]:
    """Say what an effect is and how large, and what the recordings held out show of it."""
    gain, criteria = effect.held_out, diagnosis.search.step.criteria
    values = ", ".join(quantity(name, parameter) for name, parameter in effect.parameters.items())
    said = f"{effect.title}: {effect.description}; {values}"
    doubted = gain is not None and gain.against(criteria)
    if not effect.size_determined and not doubted:
        # As little as p may be, it is more than nothing.
        chance = f"p = {effect.p_value:.1e}" if effect.p_value else "p < 1e-300"
        said += f"; it is significant ({chance}), but its size is not determined"
    if gain is None:
        return [f"Found {said}."]
    if gain.borne_out(criteria):
        return [f"Found {said}; {shown_of(gain)} on the held-out recordings."]
    words = words_of(gain, diagnosis.robot.torque_unit(diagnosis.robot.joints.index(gain.joint)))
    if doubted:
        instead = "record more motions to fit"
        return [f"In doubt: {said}.", f"Not supported by the held-out recordings: {words}; {instead}."]
    return [f"Found {said}.", f"Not confirmed by the held-out recordings: {words}."]


def _directly(name: str, headline_and_details: Parameter, fitted: Parameter) -> str:
    """Say what a channel tells of a parameter by itself, and whether the fit agrees."""
    same = abs(headline_and_details.value - fitted.value) <= DIFFERENT_STDS * np.hypot(
        headline_and_details.std, fitted.std
    )
    agree = "which agrees" if same else "which differs by more than the uncertainty"
    return f"A separate channel, without this fit, gives {quantity(name, headline_and_details)}, {agree}."


def _of_rotor(rotor: RotorInertia, diagnosis: Diagnosis) -> str:
    """Say which inertia of a rotor that nobody stated the result rests on."""
    unit = diagnosis.robot.armature_unit(diagnosis.robot.joints.index(rotor.joint))
    guess = f"it was guessed as {rotor.nominal:.2g} {unit} at the joint from the size of the motor"
    if rotor.determined and rotor.factor is not None:
        near = f"{rotor.armature:.3g} ± {rotor.armature * np.log(rotor.factor):.1g} {unit}"
        far = f"{rotor.armature:.2g} {unit} within a factor of {rotor.factor:.2g}"
        found = near if rotor.factor < NEAR_FACTOR else far
        return f"The rotor inertia of {rotor.joint} is not stated: {guess} and identified as {found}."
    return (
        f"The rotor inertia of {rotor.joint} is not stated and the data hardly determine it: {guess}, which may be "
        f"wrong by a factor of {GUESS_FACTOR:g}; parameters that depend on it have a large ±. State rotor_inertia."
    )
