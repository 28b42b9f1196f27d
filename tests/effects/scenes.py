"""Scenes with known parameters, and fits of an effect beside the base model, for the tests of effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects import Effect, EffectTerm, Member, Scene, Signals
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.terms import RigidBody
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot
from scara_ident.simulation import ReferenceMotion, VirtualArm, sampled
from tests.arms import motion, sines

Array = NDArray[np.float64]


def nominal(model: TorqueModel) -> Array:
    """Parameters of the URDF, with some friction and offset."""
    term = model.rigid_body
    value = np.full(len(model.columns), 0.02)
    assert isinstance(term, RigidBody)
    value[model.place(term)] = (term.base.grouping @ model.robot.standard_parameters())[term.kept]
    return value


def scene_of(
    robot: Robot, value: Array | None = None, *, name: str = "complete", start: dict[str, float] | None = None,
    rate: float = 1000.0, band: float = 15.0,
) -> Scene:  # fmt: skip
    model = build_model(robot, name)
    n = robot.n
    return Scene(
        model=model,
        value=nominal(model) if value is None else value,
        duration=10.0,
        rate=rate,
        band=band,
        travel=np.full(n, 2.0),
        speed=np.full(n, 2.0),
        start={"m": 0.0} if start is None else start,
        # The arm's own, which a guess would not be where the URDF says nothing.
        armatures=dict(enumerate((robot.reduction**2 * robot.rotor_inertia).tolist())),
    )


def moving(robot: Robot, duration: float = 3.0, rate: float = 500.0, seed: int = 1) -> Motion:
    time = np.arange(round(duration * rate)) / rate
    return motion(*sines(np.random.default_rng(seed), time, robot.n, lowest=0.4), rate=rate)


def columns(effect: Effect, scene: Scene, item: Motion, member: Member) -> Array:
    """Columns of a member, checked against what the effect says of them."""
    result = effect.regressor(Signals(scene, item), member)
    term = EffectTerm(effect, member, scene)
    assert result.shape == (scene.robot.n, len(term.columns), item.samples)
    assert np.all(result[~term.pattern] == 0.0)
    return result


def fit(
    model: TorqueModel, recordings: Sequence[Recording], effect: Effect, member: Member, *, band: float = 15.0,
    rounds: int = 2,
) -> tuple[Scene, Array, Array]:  # fmt: skip
    """Fit an effect beside the base model; scene, its coefficients and their covariance."""
    bands = (band,) * model.robot.n
    data = prepare(recordings, bands)
    base = wls(observe(model, data))
    start = {item.name: float(item.time[0]) for item in recordings}
    scene = scene_of(model.robot, base.value, name=model.name, start=start, rate=recordings[0].rate, band=band)
    p = len(model.columns)
    for _ in range(rounds):
        wide = TorqueModel(model.name, model.robot, (*model.terms, EffectTerm(effect, member, scene)))
        found = wls(observe(wide, data))
        scene = replace(scene, value=found.value[:p])
    return scene, found.value[p:], np.asarray(found.covariance)[p:, p:]


def wandering(arm: VirtualArm, name: str, seed: int, duration: float = 8.0) -> ReferenceMotion:
    """A periodic motion of many harmonics within range and speed of the SCARA03."""
    rng = np.random.default_rng(seed)
    k = np.arange(1, 13)
    w = 2.0 * np.pi / duration * k[None, :, None]
    size = rng.normal(size=(arm.robot.n, 12, 1)) / k[None, :, None] ** 0.8
    phase = rng.uniform(0.0, 2.0 * np.pi, (arm.robot.n, 12, 1))
    grid = np.linspace(0.0, duration, 2000)
    path = np.sum(size * np.sin(w * grid + phase), axis=1)
    speed = np.sum(size * w * np.cos(w * grid + phase), axis=1)
    middle = 0.5 * (arm.robot.lower + arm.robot.upper)
    half = 0.5 * (arm.robot.upper - arm.robot.lower)
    gain = np.minimum(0.8 * half / (0.5 * np.ptp(path, axis=1)), 2.8 / np.abs(speed).max(axis=1))
    size = gain[:, None, None] * size
    middle = (middle - gain * 0.5 * (path.max(axis=1) + path.min(axis=1)))[:, None]

    def function(t: Array) -> tuple[Array, Array, Array]:
        angle = w * t + phase
        return (
            middle + np.sum(size * np.sin(angle), axis=1),
            np.sum(size * w * np.cos(angle), axis=1),
            -np.sum(size * w * w * np.sin(angle), axis=1),
        )

    return sampled(name, arm.robot, function, duration)


def dense(slopes: Iterable[tuple[NDArray[np.intp], Array]], parameters: int) -> Array:
    """Return slopes, given joint by joint with their places, as one array, shape (n, parameters, N)."""
    found = []
    for places, rows in slopes:
        found.append(np.zeros((parameters, rows.shape[1])))
        found[-1][places] = rows
    return np.array(found)
