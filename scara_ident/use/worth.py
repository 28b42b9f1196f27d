"""The cost of each effect in tracking, and the benefit of feeding it forward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects import EffectTerm
from scara_ident.errors import UsageError
from scara_ident.export.identified_model import Entry, IdentifiedModel
from scara_ident.simulation.reference import ReferenceMotion
from scara_ident.threads import side_by_side
from scara_ident.use.identified_arm import arms_of, simulated
from scara_ident.use.tracking import foreseen_torque, tracked
from scara_ident.use.trial_motion import trial_motion
from scara_ident.use.use import use

# Poses of the motion, and effects that are looked at one by one, so that it takes seconds.
POSES, MAX_EFFECTS = 2, 4


@dataclass(frozen=True, eq=False)
class EffectWorth:
    """Rms tracking errors without one effect, shape (n,).

    Attributes
    ----------
    entry : Entry
        The effect.
    alone : ndarray
        Of an arm without it, by the PID alone.
    not_fed : ndarray or None
        Of the arm with it, where all but its torque is fed forward; None where it is no part of the model's torque.
    """

    entry: Entry
    alone: Array
    not_fed: Array | None


@dataclass(frozen=True, eq=False)
class Worth:
    """What the effects of one model are worth.

    Attributes
    ----------
    motion : ReferenceMotion
        That the arm followed.
    rms : mapping of str to ndarray, shape (n,)
        Rms tracking error by feed-forward, as of `Use.rms`.
    missing : tuple of str
        Effects that the virtual arm cannot have.
    notes : tuple of str
        See `Use`.
    """

    model: IdentifiedModel
    motion: ReferenceMotion
    rms: Mapping[str, Array]
    each: tuple[EffectWorth, ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...] = ()


def worth(model: IdentifiedModel, *, seed: int = 0) -> Worth:
    """Let one virtual arm, drawn about the model, follow a short motion with and without each effect found.

    Parameters
    ----------
    model : IdentifiedModel
        With effects.
    seed : int, optional
        Of the motion and the arm.

    Raises
    ------
    ScaraIdentError
        If no virtual arm can have the model, or any of its effects, or follow the motion.
    """
    pairs, missing = simulated(model.found)
    if not pairs:
        raise UsageError(f"the virtual arm has none of the effects found: {', '.join(missing)}")
    found = use(model, trial_motion(arms_of(model)[1], seed, poses=POSES), arms=1, seed=seed)
    arm, effects = found.drawn[0]

    def of_one(k: int) -> EffectWorth:
        entry = pairs[k][1]
        (alone,) = tracked(arm, effects[:k] + effects[k + 1 :], found.motion, {"pid": None}, seed)
        own, not_fed = _of_effect(model, entry), None
        if own is not None:
            feed = found.feeds["effects"] - foreseen_torque(replace(model, value=own), found.motion)
            (less,) = tracked(arm, effects, found.motion, {"less": feed}, seed)
            not_fed = less.rms
        return EffectWorth(entry, alone.rms, not_fed)

    each = tuple(side_by_side(of_one, range(min(len(pairs), MAX_EFFECTS))))
    return Worth(model, found.motion, found.rms(), each, missing, found.notes)


def _of_effect(model: IdentifiedModel, entry: Entry) -> Array | None:
    """Return the parameters of one effect's terms, all others zero; None where it has none."""
    own = np.zeros_like(model.value)
    terms = [
        term
        for term in model.model.terms
        if isinstance(term, EffectTerm) and (term.name, term.joint) == (entry["effect"], entry["joint"])
    ]
    for term in terms:
        own[model.model.place(term)] = model.value[model.model.place(term)]
    return own if terms else None
