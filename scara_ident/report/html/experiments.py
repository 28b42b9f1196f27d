"""What experiment to do next: what would tell effects apart, or show one that the recordings cannot."""

from __future__ import annotations

import numpy as np

from scara_ident.diagnosis.acceptance import FAMILY_ERROR, Decision
from scara_ident.diagnosis.candidate_tests import WEAK
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.search import DELAY
from scara_ident.effects.measurement import within_sampling
from scara_ident.report.diagnosis import best_by_label

# What brings each effect out against the others.
EXPERIMENTS = {
    "transmission_loss": "accelerate hard at low speed, then the same path with a known payload: a gear's loss grows with the load, friction does not",
    "stribeck": "run at eight or more constant speeds, spaced by a constant factor down to creeping",
    "asymmetric_friction": "run the same path in both directions at several constant speeds",
    "presliding": "reverse often with small amplitude at two speeds: its memory is in angle, a delay's is in time",
    "warm_up": "run the same trajectory cold and again after half an hour of motion, with the time of day recorded",
    "torque_ripple": "move slowly at constant speed over several motor turns and record at a high rate",
    "position_dependent_friction": "run over the whole stroke at constant speed in both directions: half the difference is friction",
    "spring": "hold still, or creep, at positions over the whole range: a spring grows with the angle, a tilt follows its sine",
    "base_tilt": "hold still, or creep, at positions over more than half a turn: a tilt follows the angle's sine, a spring the angle",
    "payload_change": "repeat the run with the payload fastened, and once without it",
    "time_delay": "run the same path at two speeds: a delay's error grows with the third power of speed",
    "torque_sensor_nonlinearity": "hold a known load at several torques, or repeat with a payload at the same speed",
    "torque_gain_mismatch": "repeat with a known payload: it gives both joints the same scale",
    "joint_elasticity": "excite above 5 Hz with short steps, and look for a resonance that stays at its frequency",
    "backlash": "reverse under little load, and look for the angle within which no torque is needed",
    "encoder_eccentricity": "run at two constant speeds: an error of the encoder grows with the square of speed, ripple does not",
    "friction_coupling": "move the other joint alone while this one holds still",
    "offset_drift": "hold still for the length of a run, at its beginning and at its end",
    "vibration": "record at rest with the drives on: what is periodic then does not come from the motion",
}  # fmt: skip
# Candidates of which more could be said with other recordings, at the most.
MOST = 4
MOST_LABELS = 3


def next_experiments(diagnosis: Diagnosis) -> list[str]:
    """Return in words what to record next, the most useful first."""
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
            found.append(f"To tell {_label(effect.effect, effect.joint)} from {others}: {_experiment(effect.effect)}.")
    if not diagnosis.fit_after:
        found.append("To know the noise floor: record every trajectory at least twice.")
    if not diagnosis.validation_before:
        found.append(
            "To trust the result: record a trajectory that takes no part in the diagnosis and give it with --validate."
        )
    hidden, faint = [], []
    for decision in best_by_label(diagnosis.search.decisions):
        if decision.accepted:
            continue
        if decision.examination.outside < WEAK:
            hidden.append(decision)
        elif decision.gain > 0.0 and _significant(decision, diagnosis) and _possible(decision, diagnosis):
            faint.append(decision)
    told = {effect.effect for effect in diagnosis.effects if effect.confounded_with}
    confirm: dict[str, list[str]] = {}
    for effect in diagnosis.effects:
        if effect.effect not in told:
            confirm.setdefault(effect.effect, []).append(_label(effect.effect, effect.joint))
    found += [f"To confirm {' and '.join(labels)}: {_experiment(name)}." for name, labels in confirm.items()]
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
            found.append(f"{words.format(labels, members[0].why)}: {_experiment(name)}.")
    return found


def _significant(decision: Decision, diagnosis: Diagnosis) -> bool:
    # What lies within a sample's period is how the recordings were made; no motion of the arm tells more of it.
    name, joint = decision.candidate.effect.name, decision.candidate.member.joint
    scene = diagnosis.search.scene
    if name == DELAY and joint is not None and within_sampling(float(decision.examination.value[0]), scene.rate):
        return False
    return decision.examination.p_value * diagnosis.search.tried < FAMILY_ERROR


def _possible(decision: Decision, diagnosis: Diagnosis) -> bool:
    """Whether a real arm can have the coefficients found."""
    examination, candidate = decision.examination, decision.candidate
    std = np.sqrt(np.clip(np.diag(examination.covariance), 0.0, None))
    return candidate.effect.inadmissible(diagnosis.search.scene, candidate.member, examination.value, std) is None


def _label(effect: str, joint: str | None) -> str:
    return effect if joint is None else f"{effect} of {joint}"


def _experiment(effect: str) -> str:
    return EXPERIMENTS.get(effect, "record the same path at two speeds, in both directions, with and without a payload")
