"""What each format can represent of an identified model, and the parameters with which it does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm
from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.problem import Problem
from scara_ident.estimation.consistent.solution import least_squares_arm, nearest_arm, solve_joints
from scara_ident.estimation.information import Information
from scara_ident.export.friction import JointFriction
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.export.traced_model import NOT_OF_STATE
from scara_ident.model.terms import Friction, Offset, RigidBody, Term

NO_PLACE = "the format cannot hold it"
AT_TIMES = "it was there only at times; the arm is written without it"
NOT_READ = "programs that read it ignore rotors"
# Torques of rigid bodies that differ by less, relative, are the same but for rounding.
ROUNDING_SHARE = 1e-9


@dataclass(frozen=True)
class Form:
    """What a format has a place for.

    Attributes
    ----------
    bodies : bool
        Whether it has bodies, which must be possible, rather than base parameters; its friction then brakes.
    powers : tuple of int or None
        Powers of speed that its friction has; None: all.
    armature : bool
        Whether the rotors' inertias are read.
    offset : bool
        Whether it has a constant torque per joint.
    effects : bool
        Whether it has the effects that follow from the state, and whatever other terms the model has.
    """

    bodies: bool
    powers: tuple[int, ...] | None
    armature: bool
    offset: bool
    effects: bool


@dataclass(frozen=True, eq=False)
class Said:
    """An identified model as a format says it.

    Attributes
    ----------
    value : ndarray, shape (p,)
        The model's parameters, zero where the format has no place.
    missing : tuple of (str, str)
        Terms and parameters that it cannot say, and why.
    refitted : tuple of str
        Parameters that were fitted again, to what is missing.
    """

    value: Array
    missing: tuple[tuple[str, str], ...]
    refitted: tuple[str, ...]


def possible_standard(found: IdentifiedModel) -> tuple[Array, tuple[str, ...]]:
    """Return the standard parameters, shape (11 n,), of an arm that can exist, and what to know of it.

    It is the arm that the estimate belongs to, or else the one that explains the same observations best.

    Raises
    ------
    EstimationError
        If there are no observations of any joint, or no arm is found.
    """
    if found.standard is not None:
        return found.standard, ()
    if not any(item.rows for item in found.fitted):
        raise EstimationError("the result contains no observations, so no physically consistent arm can be computed")
    # The bodies are what is wanted; friction is as the observations have it.
    problem = Problem(found.model, ConsistentOptions(friction="free"))
    information, notes = found.information, tuple[str, ...]()
    solution = least_squares_arm(problem, information)
    if solution is None:
        solution, information, _ = solve_joints(problem, found.fitted)
        notes = (
            "the identified parameters are not physically consistent; this is the consistent arm that explains the same recordings best",
        )
    x = nearest_arm(problem, information, solution.x)
    return problem.unknowns.standard(x), notes


def said_by(form: Form, found: IdentifiedModel, standard: Array | None = None) -> Said:
    """Return the parameters with which a format says a model.

    Where it lacks anything, friction and offset, as far as it has them, are fitted again to the training observations,
    all else being held. What was there in a part of the recordings, such as a payload, is held too, for it is not there in
    the arm that is written: friction does not stand in for it.

    Parameters
    ----------
    form : Form
    found : IdentifiedModel
    standard : ndarray, shape (11 n,), optional
        Of the arm, for a form with bodies.
    """
    model = found.model
    value, missing = found.value.copy(), list(_unsaid(form, found))
    if standard is not None:
        place = model.place(model.rigid_body)
        value[place] = _base(form, model.rigid_body, standard)
    absent = {term: model.place(term).start + np.array(columns) for term, columns, _ in missing}
    held = [term for term, _, why in missing if why == AT_TIMES]
    for term in set(absent) - set(held):
        value[absent[term]] = 0.0
    fitted, lower = _adjustable(form, found)
    changed = np.abs(value - found.value) > ROUNDING_SHARE * np.max(np.abs(found.value), initial=0.0)
    negative = value[fitted] < lower
    refitted: tuple[str, ...] = ()
    if len(fitted) and (np.any(changed) or np.any(negative)):
        value[fitted] = _fitted(found.information, value, fitted, lower)
        refitted = tuple(model.names[k] for k in fitted)
    for term in held:
        value[absent[term]] = 0.0
    if standard is not None and not form.armature and np.any(standard[10 * found.robot.n :]):
        missing_names = (("armature", NOT_READ), *_missing_names(found, missing))
    else:
        missing_names = tuple(_missing_names(found, missing))
    return Said(value, missing_names, refitted)


def friction_said(found: IdentifiedModel, value: Array) -> JointFriction:
    """Return Coulomb and viscous friction among parameters; not known where the recordings left them open."""
    n = found.robot.n
    both = np.full((2, n), np.nan)
    for term in found.model.terms:
        if isinstance(term, Friction):
            place = found.model.place(term)
            known = np.where(found.undetermined[place], np.nan, value[place]).reshape(n, -1)
            for power in (0, 1):
                if power in term.powers:
                    both[power] = known[:, term.powers.index(power)]
    return JointFriction(both[0], both[1])


def offset_said(found: IdentifiedModel, value: Array) -> Array:
    """Return the torque offsets among parameters, recorded side, shape (n,)."""
    term = next((term for term in found.model.terms if isinstance(term, Offset)), None)
    return np.zeros(found.robot.n) if term is None else term.of_joints(value[found.model.place(term)])


def _base(form: Form, term: RigidBody, standard: Array) -> Array:
    """Return the base parameters of standard ones as the format is read."""
    read = standard.copy()
    if not form.armature:
        read[10 * term.robot.n :] = 0.0
    return np.asarray((term.base.grouping @ read)[term.kept])


def _unsaid(form: Form, found: IdentifiedModel) -> Iterator[tuple[Term, list[int], str]]:
    """Give terms with the places of their columns that the format lacks, and why."""
    for term in found.model.terms:
        columns = list(range(len(term.columns)))
        # Of an axis that lifts its links wherever the arm is, its weight takes up the offset.
        if isinstance(term, RigidBody) or not columns:
            continue
        if isinstance(term, Friction):
            lacking = [k for k in columns if not _has(form, term.powers[k % len(term.powers)])]
            if lacking:
                yield term, lacking, NO_PLACE
        elif isinstance(term, Offset):
            if not form.offset:
                yield term, columns, NO_PLACE
        elif isinstance(term, EffectTerm) and not term.effect.of_state:
            yield term, columns, AT_TIMES if _at_times(term) else NOT_OF_STATE
        elif not form.effects:
            yield term, columns, NO_PLACE


def _at_times(term: EffectTerm) -> bool:
    """Whether an arm has it at times, and is the arm of the other parameters else: a body that links carry, or what some recordings have."""
    return term.effect.on_links or term.effect.by_recording or term.effect.in_intervals


def _has(form: Form, power: int) -> bool:
    return form.powers is None or power in form.powers


def _missing_names(found: IdentifiedModel, missing: Sequence[tuple[Term, list[int], str]]) -> Iterator[tuple[str, str]]:
    """Give what is missing by name."""
    for term, columns, why in missing:
        if isinstance(term, EffectTerm):
            yield term.name + ("" if term.joint is None else f" of {term.joint}"), why
            continue
        place = found.model.place(term)
        names = [term.columns[k].name for k in columns if found.value[place.start + k] != 0.0]
        if names:
            yield ", ".join(names), why
    for name in found.removed:
        yield name, "it was corrected in the recordings"


def _adjustable(form: Form, found: IdentifiedModel) -> tuple[NDArray[np.intp], Array]:
    """Return the places of friction and offset that the format has, and what they may not fall below.

    Of friction that the recordings leave open nothing is said. An offset that they leave open beside the bodies, as on an
    axis that goes up and down, is determined once those are what is written.
    """
    places: list[int] = []
    lower: list[float] = []
    for term in found.model.terms:
        start = found.model.place(term).start
        for k in range(len(term.columns)):
            friction = isinstance(term, Friction) and _has(form, term.powers[k % len(term.powers)])
            if (friction and not found.undetermined[start + k]) or (isinstance(term, Offset) and form.offset):
                places.append(start + k)
                lower.append(0.0 if form.bodies and form.powers is not None and friction else -np.inf)
    kept = np.array(places, dtype=np.intp)
    determined = ~found.information.select(kept).solve().undetermined if len(kept) else np.zeros(0, dtype=bool)
    determined |= ~found.undetermined[kept]
    return kept[determined], np.array(lower)[determined]


def _fitted(information: Information, value: Array, places: NDArray[np.intp], lower: Array) -> Array:
    """Return the parameters at some places that fit best beside all others."""
    from scipy.optimize import lsq_linear

    others = value.copy()
    others[places] = 0.0
    left = information.factor[:, -1] - information.factor[:, :-1] @ others
    columns = information.factor[:, places]
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    found = lsq_linear(columns / size, left, (lower, np.full(len(places), np.inf)), method="bvls", tol=1e-14)
    return np.asarray(found.x / size)


FORMS = {
    "urdf": Form(bodies=True, powers=(0, 1), armature=False, offset=False, effects=False),
    "mjcf": Form(bodies=True, powers=(0, 1), armature=True, offset=True, effects=False),
    "pinocchio": Form(bodies=True, powers=(0, 1), armature=True, offset=False, effects=False),
    "c": Form(bodies=False, powers=None, armature=True, offset=True, effects=True),
    "casadi": Form(bodies=False, powers=None, armature=True, offset=True, effects=True),
    "ros2": Form(bodies=True, powers=None, armature=True, offset=True, effects=False),
}
"""Formats by the names that the program has for them, each as other programs read its file alone."""


def with_code(form: Form) -> Form:
    """Return what a format with bodies says together with the code beside it."""
    return replace(form, powers=None, armature=True, offset=True, effects=True)
