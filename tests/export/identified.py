"""Identified models for tests of exports, without any identification: known parameters, observations of random states."""

from __future__ import annotations

import numpy as np

from scara_ident.effects import EffectTerm, Scene, available_effects
from scara_ident.estimation.information import Information
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot
from tests.export.arms import Array, random_standard

# One of each kind: with the load, at low speed, by direction, by position, by another joint, and of the measurement.
EFFECTS = (
    "transmission_loss", "stribeck", "smooth_coulomb", "asymmetric_friction", "position_dependent_friction", "torque_ripple",
    "encoder_eccentricity", "torque_sensor_nonlinearity", "inertia_coupling",
)  # fmt: skip
NOISE = 1e-3


def states(robot: Robot, seed: int, samples: int) -> Motion:
    """Random states whose speeds stay away from rest, where MuJoCo's dry friction is a soft constraint."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.lower, -2.0)[:, None], np.minimum(robot.upper, 2.0)[:, None]
    q = low + (high - low) * rng.uniform(size=(robot.n, samples))
    v = rng.choice([-1.0, 1.0], q.shape) * rng.uniform(0.5, 1.5, q.shape)
    a = rng.normal(0.0, 3.0, q.shape)
    return Motion("states", "states", np.arange(samples) / 1e9, q, v, a, None, 1e9)


def with_effects(base: TorqueModel, value: Array, names: tuple[str, ...]) -> TorqueModel:
    """A model with a member of every named effect that it can have."""
    n = base.robot.n
    scene = Scene(base, value, 10.0, 1e3, 50.0, np.full(n, 3.0), np.full(n, 3.0), {"states": 0.0})
    terms = []
    for effect in available_effects():
        members = effect.members(scene) if effect.name in names else ()
        if members and not any(term.name == effect.name for term in terms):
            terms.append(EffectTerm(effect, members[-1], scene))
    return TorqueModel(base.name, base.robot, (*base.terms, *terms))


def identified(
    robot: Robot, names: tuple[str, ...] = (), *, seed: int = 0, model: str = "complete", samples: int = 300
) -> IdentifiedModel:
    """A model of random possible bodies, friction that brakes, offsets and effects."""
    rng = np.random.default_rng(seed)
    base = build_model(robot, model)
    standard = random_standard(robot, seed, like_nominal=bool(np.all(robot.standard_parameters()[: 10 * robot.n : 10])))
    value = np.zeros(len(base.columns))
    rigid = base.rigid_body
    value[base.place(rigid)] = (rigid.base.grouping @ standard)[rigid.kept]
    for term in base.terms:
        if term is not rigid:
            value[base.place(term)] = rng.uniform(0.05, 0.2, len(term.columns))
    full = with_effects(base, value, names)
    columns = np.sqrt(np.mean(full.regressor(states(robot, seed, 50)) ** 2, axis=(0, 2)))
    # Each effect a tenth of the friction, whatever its unit.
    value = np.concatenate([value, 0.02 * rng.uniform(0.5, 1.0, len(columns) - len(value)) / columns[len(value) :]])

    def information(kind: int) -> tuple[Information, ...]:
        regressor = full.regressor(states(robot, seed + kind, samples))
        torque = np.einsum("jpn,p->jn", regressor, value) + NOISE * rng.standard_normal((robot.n, samples))
        nothing = Information.empty(len(value))
        return tuple(
            nothing.absorb_columns(np.vstack([rows, own])) for rows, own in zip(regressor, torque, strict=True)
        )

    open_ = np.zeros(len(value), dtype=bool)
    return IdentifiedModel(
        model=full, value=value, covariance=1e-4 * np.eye(len(value)), before=value[: len(base.columns)], undetermined=open_,
        weights=np.ones(robot.n), fitted=information(1), training=information(1), validation=information(2), standard=standard,
        bands=(None,) * robot.n, rms=np.full(robot.n, NOISE),
    )  # fmt: skip


def model_torque(found: IdentifiedModel, value: Array, motion: Motion) -> Array:
    """Torque of a model with parameters, recorded side."""
    return np.asarray(np.einsum("jpn,p->jn", found.model.regressor(motion), value))
