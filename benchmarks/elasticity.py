"""Elastic joints, clearance and bent torque sensors of the virtual SCARA03: what a diagnosis says, beside the truth.

    python benchmarks/elasticity.py [--seeds 2] [--first 0] [--kind elastic backlash sensor] [--seconds 15]

Of every size and seed four random motions are fitted and a fifth is held out (`virtual_motions.py`), at 500 Hz with the
encoders' steps and the paper's noise. The held-out error is over that of the model with the true nonlinear parameters at
the true estimate, its linear ones fitted to the same rows; the worst joint is shown, beside what white noise lets the fit of all
parameters of the true model expect, to first order, and what 95 % of such fits stay below. Before it stands what the recordings
can show: with that model the effect's size in standard errors of blocks of time, over those asked for, the share of the squared
residual that it removes, and, where it was not found, the size that the diagnosis says it would have found. Behind each gear is
a second encoder: what it tells by itself, without the fit, stands last.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from virtual_motions import random_motion

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.diagnosis.evidence.evidence import min_found
from scara_ident.diagnosis.fitting.linearised import linearise
from scara_ident.diagnosis.fitting.trust_region import least_squares
from scara_ident.diagnosis.testing.cluster_test import needed
from scara_ident.diagnosis.testing.selection_step import best_of_each
from scara_ident.effects import EffectTerm, Member, Scene
from scara_ident.effects.catalogue import effects_named
from scara_ident.effects.links import usual_link_inertia
from scara_ident.estimation import wls
from scara_ident.estimation.observations import observe
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.model.model import TorqueModel
from scara_ident.simulation import SimulationResult, parse_effect, simulate, truth, virtual_arm

STIFFNESSES = (1500.0, 2400.0, 4000.0, 7000.0, 12000.0, 20000.0)
WIDTHS = (5e-4, 1e-3, 2e-3, 5e-3)
BENT = (0.22, -0.22)
KINDS = ("fourier", "points", "sweep", "fourier", "sweep")
RATE = 500.0
# Draws of the noise for the 95 %.
DRAWS = 20000


def cases(kind: str) -> Iterator[tuple[str, str, float]]:
    """Give the effect as the command line has it, the parameter that is compared, and its true value."""
    arm = virtual_arm()
    if kind == "elastic":
        yield from ((f"joint_elasticity:joint1:stiffness={x:g}", "stiffness", x) for x in STIFFNESSES)
    elif kind == "backlash":
        yield from ((f"backlash:{joint}:width={x:g}", "width", x) for joint in arm.robot.joints for x in WIDTHS)
    else:
        # At the torque limit, full torque, so much is added to it.
        for joint, limit in zip(arm.robot.joints, np.abs(arm.robot.torque_limit), strict=True):
            for share in BENT:
                cubic = share / limit**2
                yield f"torque_sensor_nonlinearity:{joint}:cubic={cubic:.6g}", "cubic", cubic


def runs(effect: str, seed: int, seconds: float) -> list[SimulationResult]:
    """Simulate four runs to fit and one to hold out."""
    arm, rng = virtual_arm(), np.random.default_rng([17, seed])
    motions = [random_motion(f"m{k}", arm, kind, seconds, rng) for k, kind in enumerate(KINDS)]
    asked, both = [parse_effect(effect)], arm.robot.joints
    return [simulate(arm, item, effects=asked, seed=seed, rate=RATE, ticks=2, link_encoders=both) for item in motions]


def true_member(found: Diagnosis, runs: Sequence[SimulationResult]) -> tuple[Scene, Member]:
    """Return the scene at the arm's own parameters, and the member with the effect's own nonlinear ones."""
    arm, effect = runs[0].arm, runs[0].effects[0]
    value = np.array([item["value"] for item in truth(arm)["parameters"]])
    scene = replace(found.search.scene, value=value, armatures=dict(enumerate(arm.armature.tolist())), columns={})
    joint = arm.robot.joint_index(str(effect.joint))
    sizes = vars(effect)
    if effect.name == "joint_elasticity":
        inertia, link, rotor = usual_link_inertia(scene, joint), arm.link_inertia()[joint], arm.armature[joint]
        omega = np.sqrt(sizes["stiffness"] / inertia)
        # Its damping ratio is that of motor and link, both free.
        ratio = sizes["damping_ratio"] * np.sqrt(link * rotor / (link + rotor) / inertia)
        return scene, Member(joint, (float(omega / (2.0 * np.pi)), float(ratio)))
    return scene, Member(joint, (sizes["width"],) if effect.name == "backlash" else ())


def against_truth(found: Diagnosis, runs: Sequence[SimulationResult]) -> float:
    """Return the held-out error over that of the true model, on the worst joint."""
    scene, member = true_member(found, runs)
    (family,) = effects_named(runs[0].effects[0].name)
    base = found.search.base
    model = TorqueModel(base.name, base.robot, (*base.terms, EffectTerm(family, member, scene)))
    best = wls(observe(model, found.search.data))
    true = rms_of(best.value, observe(model, found.validation_after.data))
    own = rms_of(found.after.value, found.validation_after)
    return max(a / b for a, b in zip(own, true, strict=True) if a is not None and b is not None)


def expected_ratio(found: Diagnosis, runs: Sequence[SimulationResult]) -> tuple[float, float]:
    """Return that ratio as white noise lets the fit of all parameters of the true model expect, to first order, and its 95 %."""
    scene, member = true_member(found, runs)
    (family,) = effects_named(runs[0].effects[0].name)
    step, held_out = found.search.step, observe(found.search.base, found.validation_after.data)
    fitted, held = (
        linearise(
            replace(
                step,
                scene=replace(scene, columns=columns_at_hand(item.observations)),
                columns=item,
                chosen=(Candidate(family, member),),
                variation=None,
            )
        )
        for item in (step.columns, CandidateColumns(held_out))
    )
    rows = np.vstack([fitted.information.factor, fitted.prior.factor])[:, :-1]
    root = least_squares(rows, np.zeros(len(rows)))[1]
    # Of weighted rows the noise is the same on every joint, and divides out.
    more = [
        weight**2
        * root[joint.columns].T
        @ joint.table[:-1]
        @ joint.table[:-1].T
        @ root[joint.columns]
        / joint.table.shape[1]
        for joint, weight in zip(held.joints, step.weights, strict=True)
    ]
    drawn = np.random.default_rng(0).standard_normal((DRAWS, root.shape[1]))
    worst = np.max([np.einsum("di,ij,dj->d", drawn, item, drawn) for item in more], axis=0)
    mean, most = max(np.trace(item) for item in more), np.quantile(worst, 0.95)
    return float(np.sqrt(1.0 + mean)), float(np.sqrt(1.0 + most))


def shown(found: Diagnosis, runs: Sequence[SimulationResult], name: str) -> str:
    """Return in words what the recordings show of the effect once the true model is known."""
    scene, member = true_member(found, runs)
    (family,) = effects_named(runs[0].effects[0].name)
    step = replace(found.search.step, scene=replace(scene, columns=found.search.scene.columns), chosen=())
    (decision,) = step.judge([Candidate(family, member)])
    own = decision.examination
    errors = abs(float(own.value[0])) / float(np.sqrt(own.covariance[0, 0]))
    limits = [
        min_found(found.search, item)[name].value
        for item in best_of_each(found.search.decisions).values()
        if item.label == decision.label
    ]
    published = f"{limits[0]:.3g}" if limits else "-"
    return (
        f"{errors / needed(1, own.freedom, CRITERIA.family_error / step.tried):7.2f}{decision.gain:8.1%}{published:>9}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kind", nargs="+", default=["elastic", "backlash", "sensor"])
    parser.add_argument("--seconds", type=float, default=15.0)
    given = parser.parse_args()
    print(
        f"{'effect':52}{'seed':>5} {'verdict':12}{'shown':>7}{'removed':>8}{'limit':>9}{'found':>24}{'error':>8}{'held out':>9}"
        f"{'expected':>9}{'95 %':>7}  other effects"
    )
    for kind in given.kind:
        for effect, name, true in cases(kind):
            for seed in range(given.first, given.first + given.seeds):
                made = runs(effect, seed, given.seconds)
                recordings = [item.recording for item in made]
                found = diagnose(made[0].arm.robot, recordings[:-1], validation=recordings[-1:])
                wanted = (made[0].effects[0].name, made[0].effects[0].joint)
                own = [item for item in found.effects if (item.effect, item.joint) == wanted]
                others = ", ".join(f"{item.effect} {item.joint}" for item in found.effects if item not in own)
                line = f"{effect:52}{seed:5d} {found.verdict:12}{shown(found, made, name)}"
                if own:
                    value = own[0].parameters[name]
                    line += f"{f'{value.value:.5g} +- {value.std:.2g}':>24}{value.value / true - 1.0:8.1%}"
                    expected, most = expected_ratio(found, made)
                    line += f"{against_truth(found, made):9.3f}{expected:9.3f}{most:7.3f}"
                    others += "".join(
                        f"; {item.value:.5g} +- {item.std:.2g} ({item.value / true - 1.0:.1%})"
                        for item in own[0].direct.values()
                    )
                others += "".join(f"; {note}" for note in found.notes if "a separate channel" in note)
                print(line + ("" if own else f"{'-':>24}{'-':>8}{'-':>9}{'-':>9}{'-':>7}") + f"  {others}", flush=True)


if __name__ == "__main__":
    main()
