"""Does gravity point where the description says, whatever the arm weighs? Turned round it makes springs and weights of free bodies.

The URDF's bodies tell it at once (`scara_ident.estimation.urdf_gravity`) of an arm like its URDF. Of any other the bodies are free:
the same first moments make gravity and, where joints carry each other, inertia, so that they do not fit both under another gravity.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_gravity import elsewhere_sentence, gravity_sentence, urdf_gravity
from scara_ident.identification.channel_comparison import far_less, few, held_out, mean
from scara_ident.identification.channel_fault import MENDED
from scara_ident.identification.channel_reading import as_mapped
from scara_ident.identification.few_rows import FewRows, few_rows
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.rigid_body import RigidBody, rigid_body
from scara_ident.threads import one_blas_thread

# Share of gravity by which another direction differs.
SAME_GRAVITY = 0.01


def gravity_said(observations: Observations) -> str | None:
    """Say where gravity is not what the description says, by the URDF's bodies or by any; None where it is, or does not show.

    Parameters
    ----------
    observations : Observations
        Of a model without effects.
    """
    observations = observations.in_memory
    shown = urdf_gravity(observations)
    if shown is None:
        return None
    said = gravity_sentence(shown)
    if shown.elsewhere or shown.borne_out or few(observations):
        return said
    with one_blas_thread():
        rows = few_rows(observations)
        left = mean(rows.left(as_mapped(len(rows.q))))
        other = _other_direction(observations, rows, left)
        if other is not None:
            return elsewhere_sentence(other / np.linalg.norm(other), shown.stated)
        # Masses of another arm make gravity small beside the inertia of the URDF.
        there = left <= MENDED * left_under(rows, np.zeros(3))
    return None if there else said


def other_gravities(stated: Array) -> Iterator[Array]:
    """Return gravity along the axes of the base, either way, and the other way round, but for the stated one."""
    size = float(np.linalg.norm(stated))
    if size > 0.0:
        for direction in (*(size * side * axis for axis in np.eye(3) for side in (1.0, -1.0)), -stated):
            if np.linalg.norm(direction - stated) > SAME_GRAVITY * size:
                yield direction


def left_under(rows: FewRows, gravity: Array) -> float:
    """Return what is left of few rows under another gravity, as a share of the torque, geometric mean over joints."""
    return mean(replace(rows, model=_under(rows.model, gravity), _left={}).left(as_mapped(len(rows.q))))


def _other_direction(observations: Observations, rows: FewRows, left: float) -> Array | None:
    """Return the gravity under which free bodies leave far less than under the stated one, and any other."""
    stated = np.asarray(observations.model.robot.model.gravity.linear, dtype=float)
    each = [(left_under(rows, gravity), gravity) for gravity in other_gravities(stated)]
    least, found = min(each, key=lambda pair: pair[0])
    apart = [own for own, gravity in each if np.linalg.norm(gravity - found) > SAME_GRAVITY * np.linalg.norm(found)]
    if least > MENDED * min(left, left_under(rows, np.zeros(3)), *apart):
        return None
    other = observe(_under(observations.model, found), observations.data)
    return None if far_less(held_out(observations), held_out(other), np.inf, poor=False) is None else found


def _under(model: TorqueModel, gravity: Array) -> TorqueModel:
    """Return a model of the arm under another gravity."""
    own = model.robot.model.copy()
    own.gravity.linear = gravity
    standing = replace(model.robot, model=own)
    terms = (rigid_body(standing) if isinstance(term, RigidBody) else term for term in model.terms)
    return TorqueModel(model.name, standing, tuple(terms))
