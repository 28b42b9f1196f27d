"""Repetitions of a motion counted once: what a model lacks repeats with the motion, and so does its effect on a candidate.

Noise is another in every repetition, and five of them tell five times as much. What is missing is the same in all, so that
five blocks of one moment of a motion are one (Moulton 1990, "An illustration of a pitfall in estimating the effects of
aggregate variables on micro units").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.testing.candidate_tests import Examination, examine
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.diagnosis.testing.selection_step import SelectionStep, moments_of
from scara_ident.estimation.joint_rows import JointRows


def moments_of_blocks(step: SelectionStep) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return which moments of which motions the blocks are of.

    Returns
    -------
    tuple of ndarray of int
        Of each moment the place of its motion among the trajectories and its number there, shape (moments, 2), and its first
        block, shape (moments,); the place of each block's moment, shape (blocks,).
    """
    data = step.observations.data
    names = data.trajectories
    motion = np.array([names.index(label) for label in data.labels])[step.model.owner]
    number = moments_of(data)[step.filled]
    moments, first, place = np.unique(np.column_stack([motion, number]), axis=0, return_index=True, return_inverse=True)
    return moments, first, place.reshape(-1)


def examine_moments(step: SelectionStep, candidate: Candidate) -> Examination:
    """Examine a candidate with the blocks of one moment of a motion, in all its repetitions and periods, as one.

    Parameters
    ----------
    step : SelectionStep
        The model that it is tried beside.
    """
    model = step.model
    (own,) = step.rows(step.scene, [candidate])
    moments, first, place = moments_of_blocks(step)
    rows, joints = {}, []
    for joint, item in enumerate(model.joints):
        lengths = np.diff(item.starts)
        order = np.argsort(np.repeat(place, lengths), kind="stable")
        ends = np.cumsum(np.bincount(place, lengths).astype(np.intp))
        joints.append(
            JointRows(
                item.columns, item.table[:, order], np.append(0, ends), np.bincount(place, item.counts).astype(float)
            )
        )
        if joint in own:
            rows[joint] = own[joint][:, order]
    once = FittedModel(tuple(joints), model.parameters, moments[:, 0], model.fold[first], model.weights)
    return examine(once, [rows], step.criteria)[0]
