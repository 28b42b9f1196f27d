"""How far apart the answers to questions are, in standard errors, from a triangular factor.

The columns are those of the model, then those of the effects in question, each with the change of its torque by its
nonlinear parameters. Rows are weighted to have noise of variance one, so that what is left of a column, once others are
projected out, is as long as the standard errors that it makes. Of confounders A and B with the torque ``A a`` that A has,

    t^2 = |(I - P) A a|^2,  P the projection on the model and B with all of its parameters

is the least squared error with which B stands for A over the noise: T-optimality (Atkinson and Fedorov 1975), here
linear in B's nonlinear parameters. Rows that there are and rows that are planned merge as factors do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, Rows, with_columns
from scara_ident.diagnosis.candidates.finite_columns import torque_slope
from scara_ident.diagnosis.candidates.unknowns import sides
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.selection.search import scene_of
from scara_ident.effects import Member, Scene
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation.information import Information, merge, orthonormal
from scara_ident.estimation.observations import observe
from scara_ident.estimation.reach import Reach, reach_of
from scara_ident.estimation.working_range import believable
from scara_ident.identification.usable import usable_in_bands
from scara_ident.inquiry.questions import (
    Question,
    Suspect,
    all_suspects,
    question_of,
    questions,
    suspect_of,
    suspects_in_model,
)
from scara_ident.inquiry.shape import shape_over
from scara_ident.inquiry.torque_noise import noise_density
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.low_pass import HIGHEST_CUT
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot

# Nothing is known of a curve before but that it is no larger than so many times the rms of what is left.
LARGEST_SHAPE = 3.0
# Columns of unit length span a direction above this share.
_RANK = 1e-9
# Candidates where no diagnosis says how many were tried.
USUALLY_TRIED = 120
# Of recordings that are not at hand, Hz and s.
USUAL_RATE, USUAL_LENGTH = 1000.0, 30.0


@dataclass(frozen=True, eq=False)
class Inquiry:
    """Questions with all that is needed to say how well rows answer them.

    Attributes
    ----------
    scene : Scene
        Base model and estimate.
    questions : tuple of Question
    in_model : tuple of Suspect
        Effects that the model has.
    noise : ndarray, shape (n,)
        Of each joint's torque, (N m)^2 s; see `noise_density`. Rows of a joint where it is infinite say nothing.
    bands : tuple of float or None
        Hz.
    known : Information or None
        Of the recordings at hand, rows of unit noise; see `known_rows`.
    columns : CandidateColumns or None
        On the rows of these recordings.
    tried : int
        Candidates that the diagnosis tries.
    widening : bool
        Whether further recordings widen the bands.
    """

    scene: Scene
    questions: tuple[Question, ...]
    in_model: tuple[Suspect, ...]
    noise: Array
    bands: tuple[float | None, ...]
    known: Information | None = None
    columns: CandidateColumns | None = None
    tried: int = USUALLY_TRIED
    widening: bool = True

    @cached_property
    def reach(self) -> Reach | None:
        """How far up motion explains torque, and what counts as rest; None where no recordings are at hand."""
        if self.columns is None:
            return None
        return reach_of(self.scene.model, self.columns.observations.data, self.scene.value, widening=self.widening)

    @cached_property
    def suspects(self) -> tuple[Suspect, ...]:
        """Those in the model, then others, then the curves; the columns stand in this order behind the base model's."""
        others = [item for item in all_suspects(self.questions) if item.label not in self.labels_in_model]
        return (*self.in_model, *others, *self._shapes.values())

    @cached_property
    def labels_in_model(self) -> frozenset[str]:
        """Labels of the effects in the model."""
        return frozenset(item.label for item in self.in_model)

    def freed(self, item: Suspect) -> int:
        """Return of how many nonlinear parameters the change of its torque is asked for, as it may stand for another."""
        confounders = {own.label for asked in self.questions if asked.kind == "confounders" for own in asked.suspects}
        return len(item.candidate.effect.nonlinear) if item.label in self.labels_in_model | confounders else 0

    @cached_property
    def places(self) -> tuple[tuple[slice, slice], ...]:
        """Of each suspect its own columns, and those with its nonlinear parameters', behind the model's."""
        found, start = [], 0
        for item in self.suspects:
            own = _width(item)
            found.append((slice(start, start + own), slice(start, start + own + self.freed(item))))
            start = found[-1][1].stop
        return tuple(found)

    @cached_property
    def _shapes(self) -> dict[str, Suspect]:
        robot, found = self.scene.robot, {}
        for item in self.questions:
            if item.kind == "unexplained" and item.joint is not None:
                joint = robot.joints.index(item.joint)
                shape = shape_over(robot, item.signals, joint)
                if shape is not None:
                    found[item.text] = Suspect(Candidate(shape, Member(joint)), item.text, ())
        return found

    def rows(self, made: Callable[[Sequence[Candidate]], Sequence[Rows]]) -> list[Rows]:
        """Return every suspect's columns and the change of its torque by its nonlinear parameters.

        Parameters
        ----------
        made : callable
            Makes the columns of candidates, on whatever rows.
        """
        wanted: list[Candidate] = []
        for item in self.suspects:
            wanted.append(item.candidate)
            wanted += [side for pair in self._freed_sides(item) for side in pair[:2]]
        found = iter(made(wanted))
        result = []
        for item in self.suspects:
            own = next(found)
            wide = dict(own)
            for _, _, reach in self._freed_sides(item):
                pair = next(found), next(found)
                for joint, change in torque_slope(np.asarray(item.value), own, pair, reach).items():
                    wide[joint] = np.concatenate([wide[joint], change[None]])
            result.append(wide)
        return result

    def _freed_sides(self, item: Suspect) -> list[tuple[Candidate, Candidate, float]]:
        return sides(item.candidate) if self.freed(item) else []

    def sigmas(self, rows: Information | None = None, some: Sequence[Question] | None = None) -> Array:
        """Return standard errors between the answers to each question.

        Where no recordings are at hand, what the diagnosis said stands for them: no fit to all rows leaves less than fits
        to each, so that the squares add up to the least that all tell.

        Parameters
        ----------
        rows : Information, optional
            All that there will be, see `Blocks`; what is known by default.
        some : sequence of Question, optional
            Of the questions; all by default.
        """
        asked, rows = self.questions if some is None else some, self.known if rows is None else rows
        said = np.array([item.sigma if self.known is None else 0.0 for item in asked])
        if rows is None:
            return said
        view = self._view(rows)
        return np.asarray(np.hypot(said, [view.sigma(item) for item in asked]))

    @cached_property
    def just_seen(self) -> dict[str, Array]:
        """Half axes of the coefficients that the recordings at hand show as well as a suspect's, (k, r) by label.

        All on the ellipsoid are distinguished from none by as many standard errors as the suspect's own; where nothing is known, or
        nothing of these shows, they are alone on it.
        """
        found = {}
        for item in self.suspects:
            value = np.asarray(item.value)
            own = np.zeros((0, len(value))) if self.known is None else self._own_view.left(item, {item.label})
            shown = float(np.linalg.norm(own @ value)) if len(value) else 0.0
            found[item.label] = _axes(own / shown) if shown > 0.0 else value[:, None]
        return found

    @cached_property
    def _own_view(self) -> _View:
        assert self.known is not None
        return self._view(self.known)

    def _view(self, rows: Information) -> _View:
        p = len(self.scene.model.columns)
        return _View(self, rows.factor[:, :-1], rows.factor[p:, p:-1])


@dataclass(frozen=True, eq=False)
class _View:
    """The factor with the places of each suspect: its own columns, and those with its nonlinear parameters'."""

    inquiry: Inquiry
    factor: Array
    beside: Array

    def sigma(self, question: Question) -> float:
        if question.kind == "parameter":
            return self._parameter(question)
        if question.kind == "unexplained":
            return self._shape(question)
        if question.kind == "confounders":
            pairs = permutations(question.suspects, 2)
            names = {item.label for item in question.suspects}
            return min((self._apart(one, names, other) for one, other in pairs), default=0.0)
        # Of several the usual one: those that a motion does not tell are named.
        return float(np.median([self._from_none(item) for item in question.suspects]))

    def _place(self, wanted: Suspect) -> int:
        # An effect in the model stands there once, whoever asks for it.
        known = self.inquiry.suspects
        return known.index(wanted) if wanted in known else [item.label for item in known].index(wanted.label)

    def _model(self, without: set[str]) -> list[Array]:
        """Return what the base model leaves of the effects in it, but for some."""
        names = [item.label for item in self.inquiry.in_model]
        return [self.beside[:, self.inquiry.places[k][1]] for k, name in enumerate(names) if name not in without]

    def _apart(self, truth: Suspect, questioned: set[str], instead: Suspect | None) -> float:
        own = self.beside[:, self.inquiry.places[self._place(truth)][0]] @ np.asarray(truth.value)
        spanning = self._model(questioned)
        if instead is not None:
            spanning.append(self.beside[:, self.inquiry.places[self._place(instead)][1]])
        return float(np.linalg.norm(_outside(spanning, own)))

    def left(self, item: Suspect, questioned: set[str]) -> Array:
        """Return what the model without some effects leaves of a suspect's columns."""
        own = self.beside[:, self.inquiry.places[self._place(item)][0]]
        spanning = self._model(questioned)
        return np.column_stack([_outside(spanning, column) for column in own.T])

    def _from_none(self, item: Suspect) -> float:
        """Return how far a suspect is from none, whichever coefficients it has of those that would just have been seen.

        What is below the detection limit is found in a direction that is noise: its mean variance over all counts.
        """
        left = self.left(item, {item.label})
        singular = np.linalg.svd(left @ self.inquiry.just_seen[item.label], compute_uv=False)
        # Where no coefficient would have been seen no motion tells it either.
        return float(1.0 / np.sqrt(np.mean(1.0 / singular**2))) if len(singular) and np.all(singular > 0.0) else 0.0

    def _parameter(self, question: Question) -> float:
        model = self.inquiry.scene.model
        p, k = len(model.columns), model.names.index(question.parameter or "")
        stop = p + max((wide.stop for _, wide in self.inquiry.places[: len(self.inquiry.in_model)]), default=0)
        half = orthonormal(self.factor[:, :stop])
        known = _outside([np.delete(self.factor[:, :stop], k, axis=1)], self.factor[:, k])
        if np.linalg.norm(known) <= np.sqrt(_RANK) * np.linalg.norm(self.factor[:, k]):
            return 0.0
        return float(question.size / np.linalg.norm(half[k]))

    def _shape(self, question: Question) -> float:
        shape = self.inquiry._shapes.get(question.text)
        if shape is None:
            return 0.0
        left = self.left(shape, set())
        before = np.eye(left.shape[1]) / (LARGEST_SHAPE * question.size) ** 2
        variance = np.diag(np.linalg.inv(left.T @ left + before))
        return float(question.size / np.sqrt(np.mean(variance)))


def _axes(rows: Array) -> Array:
    """Return the half axes of the coefficients ``a`` with ``|rows a| = 1``, those of the directions that rows see."""
    _, singular, right = np.linalg.svd(rows, full_matrices=False)
    seen = singular > np.sqrt(_RANK) * singular[0]
    return np.asarray(right[seen].T / singular[seen])


def _outside(spanning: Sequence[Array], own: Array) -> Array:
    """Return what columns do not span of another."""
    if not spanning or not len(own):
        return own
    columns = np.concatenate(spanning, axis=1)
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0.0] / size[size > 0.0]
    if not columns.size:
        return own
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, singular > _RANK * singular[0]]
    return np.asarray(own - basis @ (basis.T @ own))


def _width(item: Suspect) -> int:
    if item.value:
        return len(item.value)
    from scara_ident.inquiry.shape import KNOTS, PAIR_KNOTS, Shape

    effect = item.candidate.effect
    assert isinstance(effect, Shape)
    return KNOTS if len(effect.signals) == 1 else PAIR_KNOTS**2


def known_rows(inquiry: Inquiry, columns: CandidateColumns) -> Information:
    """Return what recordings at hand say: the factor of all columns of an inquiry, rows of unit noise."""
    observations = columns.observations
    added = inquiry.rows(lambda wanted: columns.rows(inquiry.scene, wanted))
    total = observations.parameters + sum(len(next(iter(rows.values()))) for rows in added)
    rate = min(part.rate for part in observations.data.stretches)
    return merge(
        rows.information(total).scaled(float(1.0 / np.sqrt(noise * rate)))
        for rows, noise in zip(with_columns(observations, added), inquiry.noise, strict=True)
    )


def inquire(diagnosis: Diagnosis, asked: Sequence[Question] | None = None) -> Inquiry:
    """Return the questions that a diagnosis left open, with its recordings as what is known.

    Parameters
    ----------
    diagnosis : Diagnosis
    asked : sequence of Question, optional
        Some of them; all by default.
    """
    search = diagnosis.search
    chosen = questions(diagnosis) if asked is None else tuple(asked)
    noise, bands = noise_density(diagnosis), search.bands
    inquiry = Inquiry(search.scene, chosen, suspects_in_model(diagnosis), noise, bands, tried=search.tried)
    return knowing(inquiry, search.step.columns, widening=not diagnosis.bands_given)


def knowing(inquiry: Inquiry, columns: CandidateColumns, *, widening: bool) -> Inquiry:
    """Return an inquiry with the recordings of columns as what is known, and a model to foresee other motions with."""
    if not inquiry.questions:
        return inquiry
    observations, scene = columns.observations, inquiry.scene
    value = believable(observations, scene.value, inquiry.noise)
    inquiry = replace(inquiry, scene=replace(scene, value=value), columns=columns, widening=widening)
    return replace(inquiry, known=known_rows(inquiry, columns))


def inquiry_of(content: Mapping[str, Any], robot: Robot, recordings: Sequence[Recording] = ()) -> Inquiry:
    """Return the questions of a ``diagnosis.json``, with recordings at hand as what is known.

    Parameters
    ----------
    content : mapping
        Of the file.
    robot : Robot
    recordings : sequence of Recording, optional

    Raises
    ------
    ScaraIdentError
        If the file is of another robot, or holds no such questions.
    """
    try:
        if content["robot"] != robot.name:
            raise ScaraIdentError(f"diagnosis of {content['robot']}, but the robot is {robot.name}; give its robot")
        model = build_model(robot, content["model"])
        value = np.array([row["value"] for row in content["parameters"]][: len(model.columns)], dtype=float)
        asked = tuple(question_of(item) for item in content["next"] if item.get("kind"))
        in_model = tuple(suspect_of(item["suspect"]) for item in content["effects"] if item.get("suspect"))
        density = np.array([content["noise_density"][joint] for joint in robot.joints], dtype=float)
        noise = np.where(np.isnan(density), np.inf, density)
        bands = tuple(content["band_hz"][joint] for joint in robot.joints)
        tried = max(1, int(content.get("tried", USUALLY_TRIED)))
        armatures = {robot.joints.index(row["joint"]): float(row["armature"]) for row in content["rotors"]}
    except (KeyError, TypeError, ValueError) as error:
        raise ScaraIdentError(f"no questions in it ({error}); give the diagnosis.json of this version") from None
    if not recordings:
        scene = _unseen(model, value, bands, armatures)
        return Inquiry(scene, asked, in_model, noise, bands, tried=tried)
    observations = observe(model, usable_in_bands(model, recordings, (), bands, alike=True, held=True)[0])
    scene = scene_of(model, value, observations)
    scene = replace(scene, armatures={**scene.armatures, **armatures})
    inquiry = Inquiry(scene, asked, in_model, noise, bands, tried=tried)
    return knowing(inquiry, CandidateColumns(observations), widening=not content.get("band_given"))


def _unseen(model: TorqueModel, value: Array, bands: Sequence[float | None], armatures: Mapping[int, float]) -> Scene:
    """Return the scene of no recording: joints may travel as far and as fast as they can."""
    robot = model.robot
    travel = np.where(np.isfinite(robot.upper - robot.lower), robot.upper - robot.lower, 2.0 * np.pi)
    speed = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 1.0)
    band = max((band for band in bands if band is not None), default=HIGHEST_CUT * USUAL_RATE)
    return Scene(model, value, USUAL_LENGTH, USUAL_RATE, band, travel, speed, {}, dict(armatures))
