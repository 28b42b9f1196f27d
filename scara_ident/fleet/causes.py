"""Causes of change in an arm: directions in which the torque of its joints would change, and their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.effects import Scene
from scara_ident.effects.links import tool_of
from scara_ident.effects.parameters import Parameter
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Friction, Offset

# Sizes that differ from run to run on any arm: they are weighed as noise. What grows with speed follows the lubricant, the
# rest of friction the preload: they need not differ together, and what they share is estimated.
RUN_KINDS = ("coulomb", "speed", "torque_scale", "offset", "delay")
# What these make of friction as a whole and of torque scale, as a table has them beside each other.
REPORTED_RUN_KINDS = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
# Friction of these powers of speed is also looked at alone; of higher ones a recording says little.
POWERS_ALONE = 2
# What is left of a change of masses beside a body on the last link, as a share of it, up to which it is that body: no model is exact.
# A mass of which as much shows in no row is not determined.
LEFT_OF_PAYLOAD, UNDETERMINED = 0.1, 1e-6
# A parameter below so many standard deviations is no size that a share can be taken of.
SIGNIFICANT_STDS = 5.0


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that may change.

    Attributes
    ----------
    effect : str
        Name of the effect, or ``friction``, ``torque_scale``, ``offset`` or ``inertia`` for what the model has anyway.
    words : str
        What it is, for a person.
    weights : tuple of ndarray, each of shape (k, s)
        On each joint the s directions as sums of the k columns that act there; s = 0 where it does not act.
    units : tuple of str
        Of the s sizes; "1" for a share of what the reference has.
    candidate : Candidate or None
        The watched effect, whose coefficients the sizes are.
    """

    effect: str
    joint: str | None
    words: str
    weights: tuple[Array, ...]
    units: tuple[str, ...]
    candidate: Candidate | None = None

    @property
    def sizes(self) -> int:
        """How many sizes it has."""
        return len(self.units)

    @property
    def label(self) -> str:
        """Name of effect and joint, and of which part."""
        part = self.words if self.candidate is None else f"{self.effect} of {self.joint or 'the arm'}"
        if self.candidate is not None and self.candidate.effect.seeded_by:
            part += f" ({self.candidate.member.nonlinear[0]:g})"
        return part


def causes_of(
    model: TorqueModel, scene: Scene, effects: Sequence[Candidate], columns: Sequence[NDArray[np.intp]], std: Array
) -> tuple[Cause, ...]:
    """Return what may change in an arm.

    Parameters
    ----------
    scene : Scene
        With the reference's parameters.
    effects : sequence of Candidate
        Watched effects, whose columns follow the model's.
    columns : sequence of ndarray of int
        Those that act on each joint.
    std : ndarray, shape (p,)
        Of the reference's parameters.
    """
    value, robot, total = scene.value, model.robot, len(model.columns)
    found: list[Cause] = []

    def cause(effect: str, joint: int | None, words: str, whole: Array, unit: Sequence[str], only: int | None) -> None:
        each = ((j, _spread(whole, own)) for j, own in enumerate(columns))
        weights = tuple(rows if only is None or only == j else np.zeros_like(rows) for j, rows in each)
        found.append(Cause(effect, None if joint is None else robot.joints[joint], words, weights, tuple(unit)))

    kinds = _kinds(model)
    for j, joint in enumerate(robot.joints):
        own = np.zeros(total, dtype=bool)
        own[columns[j][columns[j] < total]] = True
        friction = np.where(own & (kinds == "friction"), value, 0.0)[:, None]
        if np.any(friction):
            cause("friction", j, f"friction of {joint}", friction, ("1",), j)
        cause("torque_scale", j, f"torque scale of {joint}", np.where(own, value, 0.0)[:, None], ("1",), j)
        power = 0
        for k in np.flatnonzero(own & np.isin(kinds, ("friction", "offset"))):
            column = model.columns[k]
            alone = kinds[k] == "offset" or power < POWERS_ALONE
            power += kinds[k] == "friction"
            if alone:
                determined = kinds[k] == "friction" and abs(value[k]) > SIGNIFICANT_STDS * std[k]
                unit = np.zeros((total, 1))
                unit[k] = value[k] if determined else 1.0
                cause(str(kinds[k]), j, column.meaning, unit, ("1" if determined else column.unit,), j)
        if np.any(model.constants[j]) and not np.any(own & (kinds == "offset")):
            cause("offset", j, f"torque offset of {joint}", model.constants[j][:, None], (robot.torque_unit(j),), j)
    place = np.flatnonzero(kinds == "inertia")
    if len(place):
        whole = np.zeros((total, len(place)))
        whole[place, np.arange(len(place))] = 1.0
        units = tuple(model.columns[k].unit for k in place)
        cause("inertia", None, "masses and inertias, as of a payload", whole, units, None)
    start = total
    for item in effects:
        described = item.effect.columns(scene, item.member)
        whole = np.zeros((start + len(described), len(described)))
        whole[start:] = np.eye(len(described))
        weights = tuple(_spread(whole, own) for own in columns)
        words = item.effect.description(scene, item.member)
        units = tuple(column.unit for column in described)
        found.append(Cause(item.effect.name, item.joint(scene), words, weights, units, item))
        start += len(described)
    return tuple(found)


def run_directions(
    model: TorqueModel, value: Array, columns: Sequence[NDArray[np.intp]], effects: int
) -> tuple[Array, ...]:
    """Return for each joint what one unit of each of `RUN_KINDS` is as a sum of its columns, shape (k, 5).

    Parameters
    ----------
    effects : int
        Columns of watched effects, between the model's and those of the delays.
    """
    total = len(model.columns)
    coulomb, speed = np.zeros((2, total))
    for term in model.terms:
        if isinstance(term, Friction):
            coulomb[model.place(term)] = term.of_power(0)
            speed[model.place(term)] = ~term.of_power(0)
    found = []
    for j, own in enumerate(columns):
        # An offset also where bodies' weight stands for it: if not, one that differs from date to date is another mass each time.
        whole = np.stack([coulomb * value, speed * value, value, model.constants[j], np.zeros(total)], axis=1)
        weights = _spread(whole, own)
        weights[own == total + effects + j, RUN_KINDS.index("delay")] = 1.0
        found.append(weights)
    return tuple(found)


def sizes_in_words(cause: Cause, scene: Scene, size: Array, covariance: Array) -> dict[str, Parameter]:
    """Return by name how large a change is, with what it is uncertain by.

    Of a watched effect these are its physical parameters, but for phases; of masses and inertias it is the mass of a payload,
    if a body on the last link makes that change and its mass is determined.
    """
    if cause.effect == "inertia":
        mass = _payload(scene, size, covariance)
        return {} if mass is None else {"mass": mass}
    if cause.candidate is None:
        names = ("",) if cause.sizes == 1 else tuple(f"size{k + 1}" for k in range(cause.sizes))
        std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
        return {
            name: Parameter(float(x), float(s), unit)
            for name, x, s, unit in zip(names, size, std, cause.units, strict=True)
        }
    determined = cause.candidate.effect.parameters(scene, cause.candidate.member, size, covariance)
    return {name: item for name, item in determined.items() if np.isfinite(item.std) and name != "phase"}


def _payload(scene: Scene, size: Array, covariance: Array) -> Parameter | None:
    """Return the mass of a body on the last link that changes the base parameters by this; None where none does, or it is not determined."""
    term, last = scene.model.rigid_body, 10 * tool_of(scene.robot).joint
    columns = term.base.grouping[term.kept, last : last + 10]
    variances, axes = np.linalg.eigh(covariance)
    determined = variances > np.finfo(float).eps * len(variances) * max(float(variances[-1]), 0.0)
    white = (axes[:, determined] / np.sqrt(variances[determined])).T
    rows, change = white @ columns, white @ size
    units = np.linalg.norm(rows, axis=0)
    units[units == 0.0] = 1.0
    inverse = np.linalg.pinv(rows / units, rcond=UNDETERMINED) / units[:, None]
    mass, left = inverse[0], change - rows @ (inverse @ change)
    # What a mass of 1 kg is taken for, in parts of each of the body's ten parameters.
    taken = (mass @ rows) * units[0] / units
    is_body = np.linalg.norm(left) <= LEFT_OF_PAYLOAD * np.linalg.norm(change)
    if not is_body or np.linalg.norm(taken - np.eye(len(taken))[0]) > UNDETERMINED:
        return None
    return Parameter(float(mass @ change), float(np.linalg.norm(mass)), "kg")


def _kinds(model: TorqueModel) -> NDArray[np.str_]:
    kinds = np.full(len(model.columns), "other", dtype="U8")
    for term in model.terms:
        name = "friction" if isinstance(term, Friction) else "offset" if isinstance(term, Offset) else "other"
        kinds[model.place(term)] = "inertia" if term is model.rigid_body else name
    return kinds


def _spread(whole: Array, own: NDArray[np.intp]) -> Array:
    """Return the rows of some columns; zero for those beyond the last."""
    rows = np.zeros((len(own), whole.shape[1]))
    rows[own < len(whole)] = whole[own[own < len(whole)]]
    return rows
