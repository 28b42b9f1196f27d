"""A diagnosis as JSON, with the contract's keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.evidence.evidence import min_found
from scara_ident.diagnosis.fitting.effect_parameters import RotorInertia
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.estimation.estimate import joint_errors
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.estimation.urdf_scale import urdf_scale
from scara_ident.export.result import KEY, rebuild_entry
from scara_ident.inquiry.next_steps import next_steps
from scara_ident.inquiry.questions import suspects_in_model
from scara_ident.inquiry.torque_noise import noise_density
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.recorded_range import recorded_range
from scara_ident.report.diagnosis_words import headline_and_details
from scara_ident.report.identification import bias_of
from scara_ident.report.left_out import left_out_share
from scara_ident.report.moved import moved


def diagnosis_dict(diagnosis: Diagnosis, worth: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the content of ``diagnosis.json``.

    Parameters
    ----------
    worth : mapping, optional
        What `scara_ident.report.use.worth_dict` says of the effects found.
    """
    robot = diagnosis.robot
    nominal = urdf_values(diagnosis.after.model)
    suspects = {item.candidate: item for item in suspects_in_model(diagnosis)}
    first, others = headline_and_details(diagnosis)
    return {
        "robot": robot.name,
        "model": diagnosis.before.model.name,
        "verdict": diagnosis.verdict,
        "doubts": list(first),
        "summary": [*first, *others],
        "band_hz": robot.by_joint(diagnosis.search.bands),
        "band_given": diagnosis.bands_given,
        "torque_units": robot.torque_units,
        "noise_floor": {fit.joint: fit.noise for fit in diagnosis.fit_after} or dict.fromkeys(robot.joints),
        "lack_of_fit": {
            "before": {fit.joint: fit.missing for fit in diagnosis.fit_before},
            "after": {fit.joint: fit.missing for fit in diagnosis.fit_after},
            "p_value": {fit.joint: fit.p_value for fit in diagnosis.fit_after},
        },
        "effects": [
            {
                "effect": effect.effect,
                "joint": effect.joint,
                "description": effect.description,
                "parameters": {name: parameter.entry() for name, parameter in effect.parameters.items()},
                "intervals": intervals(effect, diagnosis),
                "size_determined": effect.size_determined,
                "direct": {name: parameter.entry() for name, parameter in effect.direct.items()},
                "confounded_with": list(dict.fromkeys(confounder.effect for confounder in effect.confounded_with)),
                "confounders": [
                    {"effect": confounder.effect, "joint": confounder.joint, "gain": confounder.gain}
                    for confounder in effect.confounded_with
                ],
                "p_value": effect.p_value,
                "gain": effect.gain,
                "held_out": None if effect.held_out is None else effect.held_out.entry(),
                "helps_in": list(effect.votes),
                "training": {"before": dict(effect.before), "after": dict(effect.after)},
                "suspect": suspects[effect.candidate].entry() if effect.candidate in suspects else None,
            }
            for effect in diagnosis.effects
        ],
        "tentative": [
            {name: value for name, value in vars(item).items() if name != "decision"} for item in diagnosis.tentative
        ],
        "next": [item.entry() for item in next_steps(diagnosis)],
        "noise_density": robot.by_joint(noise_density(diagnosis).tolist()),
        "events": [event.entry for event in diagnosis.events],
        "evidence": {
            item.joint: {
                "noise": item.shown,
                "by": item.by,
                "why": item.why,
                "lacks": item.lacks,
                "detection_limit": None if np.isnan(item.limit) else item.limit,
            }
            for item in diagnosis.evidence
        },
        "rotors": [_rotor(rotor, diagnosis) for rotor in diagnosis.rotors],
        "training": _before_after(diagnosis, diagnosis.training_before, diagnosis.training_after),
        "validation": _before_after(diagnosis, diagnosis.validation_before, diagnosis.validation_after),
        "range": recorded_range(diagnosis.training_after.data).entry(robot),
        "left_out": {
            "training": left_out_share(diagnosis.training_after),
            "validation": left_out_share(diagnosis.validation_after),
        },
        "recordings": {
            kind: {
                item.name: {
                    "before": robot.by_joint(rms_of(diagnosis.before.value, item)),
                    "after": robot.by_joint(rms_of(diagnosis.after.value, later)),
                }
                for item, later in zip(before.each, after.each, strict=True)
            }
            for kind, before, after in (
                ("training", diagnosis.training_before, diagnosis.training_after),
                ("validation", diagnosis.validation_before, diagnosis.validation_after),
            )
        },
        "moved": moved(diagnosis),
        "parameters": [
            column.entry(value=diagnosis.after.value[k], std=diagnosis.after.std[k], urdf=nominal[k])
            | ({"before": diagnosis.before.value[k]} if k < len(diagnosis.before.model.columns) else {})
            for k, column in enumerate(diagnosis.after.model.columns)
        ],
        "urdf_scale": urdf_scale(diagnosis.after, diagnosis.training_after),
        "run_variation": diagnosis.after.variation.sizes(diagnosis.robot) if diagnosis.after.variation else {},
        "noise_bias": bias_of(diagnosis.after),
        "not_identifiable": [
            {
                "effect": alias.effect,
                "joints": list(alias.joints),
                "absorbed_by": list(alias.absorbed_by),
                "opened_by": alias.opened_by,
            }
            for alias in diagnosis.aliases
        ],
        "candidates": [_candidate(decision, diagnosis) for decision in best_by_label(diagnosis.search.decisions)],
        "tried": diagnosis.search.tried,
        "unexplained": _unexplained(diagnosis),
        "worth": worth,
        "notes": list(diagnosis.notes),
        KEY: rebuild_entry(diagnosis.after, diagnosis.training_after, diagnosis.validation_after),
    }


def best_by_label(decisions: Sequence[Decision]) -> list[Decision]:
    """Return the best scan point of each family and joint, the most gaining first."""
    best: dict[str, Decision] = {}
    for decision in decisions:
        held = best.get(decision.label)
        if held is None or decision.gain > held.gain:
            best[decision.label] = decision
    return sorted(best.values(), key=lambda item: -item.gain)


def beyond_chance(candidates: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the candidates that chance does not explain: one that it does says nothing that others do not.

    Parameters
    ----------
    candidates : sequence of mapping
        Those of ``diagnosis.json``.
    """
    return [row for row in candidates if row["p_value"] < 1.0]


def _candidate(decision: Decision, diagnosis: Diagnosis) -> dict[str, Any]:
    scene = diagnosis.search.scene
    helps, voting = decision.examination.votes
    return {
        "effect": decision.candidate.effect.name,
        "joint": decision.candidate.joint(scene),
        "label": decision.label,
        "p_value": min(1.0, decision.examination.p_value * diagnosis.search.tried),
        "decision": "accepted" if decision.accepted else "rejected",
        "why": decision.why,
        "gain": decision.gain,
        "helps_in": [helps, voting],
        "outside_model": decision.examination.outside,
        "detection_limit": {name: item.value for name, item in min_found(diagnosis.search, decision).items()},
        "nonlinear": {
            parameter.name: value
            for parameter, value in zip(
                decision.candidate.effect.nonlinear, decision.candidate.member.nonlinear, strict=True
            )
        },
    }


def intervals(effect: FoundEffect, diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the stretches of recordings in which an effect acts, where it acts in some, s since each began."""
    names = list(diagnosis.search.scene.start)
    return [
        {
            "recording": names[item.recording],
            "from": item.start,
            "from_std": item.start_std,
            "to": item.stop,
            "to_std": item.stop_std,
        }
        for item in (() if effect.candidate is None else effect.candidate.member.intervals)
    ]


def _rotor(rotor: RotorInertia, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "joint": rotor.joint,
        "armature": rotor.armature,
        "factor": rotor.factor,
        "unit": _armature_unit(rotor, diagnosis),
        "nominal": rotor.nominal,
        "stated": rotor.stated,
        "determined": rotor.determined,
    }


def _armature_unit(rotor: RotorInertia, diagnosis: Diagnosis) -> str:
    robot = diagnosis.robot
    return robot.armature_unit(robot.joints.index(rotor.joint))


def _unexplained(diagnosis: Diagnosis) -> dict[str, Any] | None:
    remainder = diagnosis.unexplained
    if remainder is None:
        return None
    return {
        "joint": remainder.joint,
        "signals": list(remainder.signals),
        "rms": remainder.rms,
        "explained_share": remainder.explained,
    }


def _before_after(diagnosis: Diagnosis, old: Observations, new: Observations) -> dict[str, dict[str, float | None]]:
    if not old.data.recordings:
        return {"before": {}, "after": {}}
    result: dict[str, dict[str, float | None]] = {}
    differ = diagnosis.after.offsets is not None
    for name, estimate, observations in (("before", diagnosis.before, old), ("after", diagnosis.after, new)):
        errors = joint_errors(estimate.value, observations, own_offsets=differ)
        pairs = list(zip(diagnosis.robot.joints, errors, strict=True))
        result[name] = {joint: error.rms if error else None for joint, error in pairs}
        result[f"{name}_relative"] = {joint: error.relative if error else None for joint, error in pairs}
        result[f"{name}_unfiltered"] = {joint: error.rms_unfiltered if error else None for joint, error in pairs}
        if differ:
            result[f"{name}_own_offset"] = {joint: error.rms_own_offset if error else None for joint, error in pairs}
    return result
