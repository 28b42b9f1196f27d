"""One arm on one date: its parameters, and triangular factors in which every change can be looked for.

This is what a process of the fleet does. A recording goes in; what comes out is of the size of the model.
"""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, Rows, columns_at_hand, with_columns
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.effects import Scene
from scara_ident.effects.catalogue import available_effects
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.information import Information
from scara_ident.estimation.observations import Observations
from scara_ident.fleet.folder import Fault, RecordingFile, fetched
from scara_ident.identification.identify import identify
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.recording.recording import Recording, read_recording
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_thread


@dataclass(frozen=True, eq=False)
class Reference:
    """How all dates of an arm are looked at, from its first: what then differs is the arm and not the look.

    Attributes
    ----------
    bands : tuple of float or None
        Hz, see `identify`.
    value : ndarray, shape (p,)
        Parameters that predict the load of gears and the size of shares.
    travel, speed : ndarray, shape (n,)
    reach : tuple of float
        Longest recording (s), lowest rate and highest band (Hz): with the two above, which effects can be seen.
    armatures : tuple of (int, float)
        See `scara_ident.effects.Scene`.
    """

    bands: tuple[float | None, ...]
    value: Array
    travel: Array
    speed: Array
    reach: tuple[float, float, float]
    armatures: tuple[tuple[int, float], ...]

    def scene(self, model: TorqueModel, observations: Observations | None = None) -> Scene:
        """Return what effects ask for, with the columns of observations where they are given."""
        columns = {} if observations is None else columns_at_hand(observations)
        recordings = () if observations is None else observations.data.sources
        start = {item.name: float(item.time[0]) for item in recordings}
        sizes = (*self.reach, self.travel, self.speed, start)
        return Scene(model, self.value, *sizes, dict(self.armatures), columns)


@dataclass(frozen=True, eq=False)
class Visit:
    """What one arm shows on one date.

    The columns of the factors are those of the model, then those of the watched effects, then one delay for each joint.

    Attributes
    ----------
    value, std : ndarray, shape (p,)
        As `identify` estimates them.
    error : ndarray, shape (n,)
        Rms residual within the band as a share of the torque's; NaN for a joint at rest.
    columns : tuple of ndarray of int
        Those that act on each joint.
    factors : tuple of ndarray
        For each joint the triangular factor of its columns and its torque.
    rows : ndarray, shape (n,)
        Rows behind each factor.
    faults : tuple of Fault
        Recordings that were left out.
    """

    value: Array
    std: Array
    error: Array
    columns: tuple[NDArray[np.intp], ...]
    factors: tuple[Array, ...]
    rows: Array
    reference: Reference
    faults: tuple[Fault, ...] = ()


def watched(scene: Scene) -> tuple[Candidate, ...]:
    """Return the effects that a fleet is watched for, each in the form with the fewest coefficients.

    Of a family with a nonlinear parameter the middle value stands for all, but lines of a spectrum each for themselves.
    """
    found: dict[tuple[str, int | None, tuple[float, ...]], Candidate] = {}
    for effect in available_effects():
        if not effect.watched:
            continue
        each = sorted(effect.members(scene), key=lambda member: -1 if member.joint is None else member.joint)
        for joint, same in groupby(each, key=lambda member: member.joint):
            members = list(same)
            kept = members if effect.seeded_by else [members[len(members) // 2]]
            for member in kept:
                key = (effect.name, joint, member.nonlinear if effect.seeded_by else ())
                held = found.get(key)
                item = Candidate(effect, member)
                if held is None or _size(item, scene) < _size(held, scene):
                    found[key] = item
    return tuple(found.values())


def look(
    robot: bytes, model: str, files: Sequence[RecordingFile], reference: Reference | None = None
) -> tuple[Visit | None, tuple[Fault, ...]]:
    """Identify an arm from its recordings of one date.

    Parameters
    ----------
    robot : bytes
        A pickled `Robot`.
    files : sequence of RecordingFile
        At least one; of one arm and date.
    reference : Reference, optional
        Of the arm's first date; without it this is the first.

    Returns
    -------
    visit : Visit or None
        None where nothing can be said.
    faults : tuple of Fault
        Then why not.
    """
    equation = _equation(robot, model)
    with one_thread():
        recordings, faults = read_files(equation.robot, files)
        if not recordings:
            return None, tuple(faults)
        try:
            visit = _visit(equation, recordings, reference)
        except (ScaraIdentError, ArithmeticError, ValueError, IndexError, np.linalg.LinAlgError) as error:
            why = error if isinstance(error, ScaraIdentError) else f"{type(error).__name__}: {error}"
            words = f"{files[0].arm}, {files[0].date}: {' '.join(str(why).split())}"
            return None, (*faults, Fault(files[0].arm, files[0].date, None, words))
        return replace(visit, faults=tuple(faults)), ()


def read_files(robot: Robot, files: Sequence[RecordingFile]) -> tuple[list[Recording], list[Fault]]:
    """Read recordings; those that cannot be used are faults."""
    found: dict[str, Recording] = {}
    faults = []
    with ExitStack() as copies:
        for file in files:
            path = file.url
            try:
                path = str(fetched(file.url, copies))
                recording = read_recording(path, robot)
            except (ScaraIdentError, OSError) as error:
                passing = isinstance(error, OSError)
                why = _why(error).replace(path, file.place)
                faults.append(Fault(file.arm, file.date, file.place, why, passing))
                continue
            # Results and effects know recordings by their names.
            name = recording.name if recording.name not in found else file.place
            found[name] = replace(recording, name=name, path=None)
    return list(found.values()), faults


def _why(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"cannot be read: {(error.strerror or str(error)).lower()}"
    # The place within the fleet stands before it; that of a copy would say nothing.
    return " ".join(str(error).split()).partition(": ")[2] or str(error)


@lru_cache(maxsize=4)
def _equation(robot: bytes, model: str) -> TorqueModel:
    return build_model(pickle.loads(robot), model)


def _visit(model: TorqueModel, recordings: Sequence[Recording], reference: Reference | None) -> Visit:
    result = identify(model.robot, recordings, model=model, bands=None if reference is None else reference.bands)
    # What is added stands beside the samples that are held.
    observations, estimate = result.training.in_memory, result.estimate
    if reference is None:
        scene = scene_of(model, estimate.value, observations)
        reach = (scene.duration, scene.rate, scene.band)
        armatures = tuple(scene.armatures.items())
        reference = Reference(result.bands, estimate.value, scene.travel, scene.speed, reach, armatures)
    scene = reference.scene(model, observations)
    added = CandidateColumns(observations).rows(scene, watched(scene))
    # What one second of delay of each joint's torque does on its rows.
    delays: list[Rows] = [{j: own[None]} for j, own in enumerate(observations.late(reference.value))]
    rows = with_columns(observations, [*added, *delays])
    if estimate.offsets is not None:
        # What gravity takes up of the runs' own would be another change on each date.
        rows = estimate.offsets.whitened_rows(rows)
    known = [Information.empty(len(item.columns)).absorb_columns(item.table).factor for item in rows]
    errors = [
        np.nan if item is None or item.relative is None else item.relative for item in estimate.errors(result.training)
    ]
    return Visit(
        estimate.value,
        np.where(estimate.undetermined, np.inf, estimate.std),
        np.array(errors),
        tuple(item.columns for item in rows),
        tuple(known),
        np.array([item.table.shape[1] for item in rows], dtype=float),
        reference,
    )


def _size(candidate: Candidate, scene: Scene) -> int:
    return len(candidate.effect.columns(scene, candidate.member))
