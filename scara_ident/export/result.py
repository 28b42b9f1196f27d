"""An identified model in its result file: what it was found on, and what rebuilds it without the recordings."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.effects import EFFECTS, Effect, EffectTerm, Interval, Member, Scene
from scara_ident.effects.signals import ModelledEffect
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation import Estimate
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.estimation.information import Information
from scara_ident.estimation.observations import Observations
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.files import path_fault, unreadable
from scara_ident.memory import read_text
from scara_ident.model import MODELS
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.recorded_range import range_of_entry
from scara_ident.robot.description import check_description
from scara_ident.robot.robot import Robot, build_robot, load_robot
from scara_ident.robot.signal_map import recording_entry

KEY = "rebuild"
# Values of an effect's options that a file can hold.
PLAIN = (bool, int, float, str, tuple, frozenset)


def rebuild_entry(estimate: Estimate, training: Observations, validation: Observations) -> dict[str, Any]:
    """Return what a result file holds under ``rebuild``."""
    robot, terms = estimate.model.robot, estimate.model.terms
    effects = [term for term in terms if isinstance(term, EffectTerm)]
    active = training.model.active
    kinds = {"training": training.by_joint, "validation": validation.by_joint}
    if estimate.offsets is not None or estimate.followed is not None:
        kinds["fitted"] = estimate.rows(training)
    return {
        "robot": _robot_entry(robot),
        "covariance": _packed(estimate.covariance),
        "weights": estimate.weights,
        "std_kind": estimate.std_kind,
        "standard": estimate.standard if isinstance(estimate, ConsistentEstimate) else None,
        "scene": _scene_entry(effects[0].scene) if effects else None,
        "effects": [_effect_entry(term.effect, term.member) for term in effects],
        "observations": {
            kind: [_factor_entry(item, own) for item, own in zip(rows, active, strict=True)]
            for kind, rows in kinds.items()
        },
    }


def read_identified(
    path: Path | str, robot: Robot | Path | str | None = None, *, determined: bool = False
) -> IdentifiedModel:
    """Read the model of an ``identification.json``, or of a ``diagnosis.json`` with the effects found.

    Parameters
    ----------
    path : path
    robot : Robot or path, optional
        A robot or its description to take instead of the one that the result was found with, where that has moved.
    determined : bool, optional
        Whether every parameter must be determined.

    Raises
    ------
    ScaraIdentError
        In one line: the file cannot be read or is none of these, its robot is not to be had, or it leaves a parameter open.
    """
    path = Path(path)
    content = read_content(path)
    try:
        return _model_of(content, path, robot, determined)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise _damaged(path, error) from error


def _model_of(
    content: Mapping[str, Any], path: Path, robot: Robot | Path | str | None, determined: bool
) -> IdentifiedModel:
    known = content[KEY]
    given = robot if robot is None or isinstance(robot, Robot) else load_robot(robot)
    arm = _robot(known["robot"], path) if given is None else given
    if content["model"] not in MODELS.names():
        raise ScaraIdentError(f"{path}: model {content['model']!r} is not known here; install the package that adds it")
    base = build_model(arm, content["model"])
    model = _with_effects(base, known, path)
    parameters = content["parameters"]
    entries = [(item["name"], item["joint"], item["meaning"]) for item in parameters]
    if entries != [(column.name, column.joint, column.meaning) for column in model.columns]:
        raise ScaraIdentError(
            f"{path}: its parameters are not those of {arm.urdf}; give {asked_for('--robot')} of the arm it was found on"
        )
    observations = {
        kind: tuple(_information(item, own, len(parameters)) for item, own in zip(rows, model.active, strict=True))
        for kind, rows in known["observations"].items()
    }
    open_ = np.array([bool(item.get("undetermined", item["std"] is None)) for item in parameters])
    if determined and open_.any():
        missing = model.names[int(np.argmax(open_))]
        raise ScaraIdentError(f"{path}: parameter {missing!r} has no value; record motion that determines it")
    upper = _unpacked(known["covariance"], len(parameters), len(parameters))
    bands = content.get("band_hz") or {}
    return IdentifiedModel(
        model=model,
        value=_array([item["value"] for item in parameters]),
        covariance=upper + np.triu(upper, 1).T,
        before=_array([item.get("before", item["value"]) for item in parameters[: len(base.columns)]]),
        undetermined=open_,
        weights=_array(known["weights"]),
        fitted=observations.get("fitted", observations["training"]),
        training=observations["training"],
        validation=observations["validation"],
        standard=None if known["standard"] is None else _array(known["standard"]),
        bands=tuple(bands.get(joint) for joint in arm.joints),
        rms=_rms(content, arm.joints),
        found=tuple(content.get("effects", ())),
        # Results of earlier versions, and of files read in parts, have none.
        reached=range_of_entry(content["range"], arm) if content.get("range") else None,
    )


def _rms(content: Mapping[str, Any], joints: Sequence[str]) -> Array:
    """Return the rms error over the recordings held out, else over those fitted, all counted alike; NaN where none is given."""
    for kind in ("validation", "training"):
        # Of a diagnosis, where what was not held out has no errors.
        whole = (content.get(kind) or {}).get("after_unfiltered")
        if whole:
            return np.array([whole[joint] for joint in joints], dtype=float)
    errors = content.get("errors") or {}
    runs = [run for run in (errors.get("validation") or errors.get("training") or {}).values() if run]
    found = np.full(len(joints), np.nan)
    for j, joint in enumerate(joints):
        # A joint at rest has no error in a run.
        each = [run[joint]["rms_unfiltered"] for run in runs if run.get(joint)]
        entries = [float(rms) for rms in each if rms is not None]
        if entries:
            found[j] = float(np.sqrt(np.mean(np.square(entries))))
    return found


def read_robot(path: Path) -> Robot | None:
    """Return the robot that an ``identification.json`` or ``diagnosis.json`` was found with; None where it names none.

    Raises
    ------
    ScaraIdentError
        In one line: the file cannot be read, or its robot is not to be had.
    """
    if (fault := path_fault(path)) is not None:
        raise ScaraIdentError(fault)
    content = _json(path)
    try:
        return _robot(content[KEY]["robot"], path) if isinstance(content, dict) and KEY in content else None
    except (KeyError, TypeError) as error:
        raise _damaged(path, error) from error


def read_content(path: Path) -> dict[str, Any]:
    """Return what an ``identification.json`` or ``diagnosis.json`` holds.

    Raises
    ------
    ScaraIdentError
        In one line, if it cannot be read or is none of these.
    """
    if (fault := path_fault(path)) is not None:
        raise ScaraIdentError(fault)
    content = _json(path)
    if not isinstance(content, dict) or not {KEY, "model", "parameters"} <= set(content):
        raise ScaraIdentError(
            f"{path}: holds no model; give an identification.json or diagnosis.json, and make one of an earlier version again"
        )
    return content


def _json(path: Path) -> Any:
    try:
        return json.loads(read_text(path))
    except OSError as error:
        raise unreadable(path, error, "give an identification.json or diagnosis.json") from None
    except (ValueError, RecursionError):
        raise ScaraIdentError(f"{path}: not JSON; give an identification.json or diagnosis.json") from None


def _damaged(path: Path, error: Exception) -> ScaraIdentError:
    return ScaraIdentError(f"{path}: damaged, or of another version ({type(error).__name__}: {error}); make it again")


def _robot_entry(robot: Robot) -> dict[str, Any]:
    limits = {"acceleration_limit": robot.acceleration_limit, "jerk_limit": robot.jerk_limit}
    joints = {
        name: {"reduction": float(robot.reduction[j]), "effort_gain": float(robot.effort_gain[j])}
        | ({"rotor_inertia": float(robot.rotor_inertia[j])} if robot.rotor_stated[j] else {})
        | {key: float(limit[j]) for key, limit in limits.items() if np.isfinite(limit[j])}
        for j, name in enumerate(robot.joints)
    }
    return {
        "urdf": str(Path(robot.urdf).resolve()),
        "sha256": sha256(Path(robot.urdf).read_bytes()).hexdigest(),
        "description": {
            "effort_side": robot.effort_side,
            "joints": joints,
            "locked": dict(robot.locked),
            "gravity": robot.model.gravity.linear.tolist(),
        }
        | ({} if robot.channels is None else {"recording": recording_entry(robot.channels, robot.joints)}),
    }


def _robot(entry: Mapping[str, Any], path: Path) -> Robot:
    urdf = Path(entry["urdf"])
    if not urdf.is_file():
        raise ScaraIdentError(
            f"{path}: the URDF that it was found with, {urdf}, is not there; give {asked_for('--robot')}"
        )
    if sha256(urdf.read_bytes()).hexdigest() != entry["sha256"]:
        raise ScaraIdentError(
            f"{path}: {urdf} has changed since; give the URDF that it was found with as {asked_for('--robot')}"
        )
    return build_robot(check_description({"urdf": str(urdf), **entry["description"]}, path), path)


def _scene_entry(scene: Scene) -> dict[str, Any]:
    numbers = {name: getattr(scene, name) for name in ("value", "duration", "rate", "band", "travel", "speed", "start")}
    on_links = [_effect_entry(item.effect, item.member) | {"value": list(item.value)} for item in scene.link_torques]
    together = [_effect_entry(effect, member) for effect, member in scene.together]
    armatures = {str(joint): value for joint, value in scene.armatures.items()}
    return numbers | {"armatures": armatures, "on_links": on_links, "together": together}


def _effect_entry(effect: Effect, member: Member) -> dict[str, Any]:
    options = {field.name: getattr(effect, field.name) for field in fields(effect)}
    plain = all(isinstance(value, PLAIN) for value in options.values())
    return {
        "effect": effect.name,
        "family": type(effect).__name__,
        "options": {key: sorted(x) if isinstance(x, frozenset) else x for key, x in options.items()} if plain else None,
        "joint": member.joint,
        "nonlinear": list(member.nonlinear),
        "partner": member.partner,
        "intervals": [list(astuple(item)) for item in member.intervals],
    }


def _with_effects(base: TorqueModel, known: Mapping[str, Any], path: Path) -> TorqueModel:
    if not known["effects"]:
        return base
    entry = known["scene"]
    scene = Scene(
        base,
        *(_array(entry["value"]), entry["duration"], entry["rate"], entry["band"]),
        *(_array(entry["travel"]), _array(entry["speed"]), entry["start"]),
        armatures={int(joint): value for joint, value in entry["armatures"].items()},
        # Results of earlier versions have none.
        link_torques=tuple(
            ModelledEffect(_family(item, path), _member(item), tuple(item["value"]))
            for item in entry.get("on_links", ())
        ),
        together=tuple((_family(item, path), _member(item)) for item in entry.get("together", ())),
    )
    terms = [EffectTerm(_family(item, path), _member(item), scene) for item in known["effects"]]
    return TorqueModel(base.name, base.robot, (*base.terms, *terms))


def _member(entry: Mapping[str, Any]) -> Member:
    # Results of earlier versions have no intervals.
    intervals = tuple(Interval(*item) for item in entry.get("intervals", ()))
    return Member(entry["joint"], tuple(entry["nonlinear"]), entry["partner"], intervals)


def _family(entry: Mapping[str, Any], path: Path) -> Effect:
    for family in EFFECTS.get(entry["effect"]):
        if type(family).__name__ == entry["family"] and entry["options"] is not None:
            given = entry["options"].items()
            return type(family)(
                **{key: type(getattr(family, key))(x) if isinstance(x, list) else x for key, x in given}
            )
    raise ScaraIdentError(
        f"{path}: the effect {entry['effect']} cannot be made again: no kind {entry['family']} of it is installed, or it has "
        "options that are no plain values"
    )


def _factor_entry(information: Information, active: NDArray[np.intp]) -> dict[str, Any]:
    factor = information.select(active).factor
    return {"samples": information.rows, "rows": len(factor), "factor": _packed(factor)}


def _information(entry: Mapping[str, Any], active: NDArray[np.intp], parameters: int) -> Information:
    factor = _unpacked(entry["factor"], entry["rows"], len(active) + 1)
    return Information(factor, float(entry["samples"])).embed(active, parameters)


def _packed(matrix: Array) -> str:
    """Return the upper triangle of a matrix, row by row, as base64 of little-endian doubles."""
    numbers = matrix[np.triu_indices(len(matrix), 0, matrix.shape[1])]
    return base64.b64encode(numbers.astype("<f8").tobytes()).decode("ascii")


def _unpacked(text: str, rows: int, columns: int) -> Array:
    """Return a matrix with this upper triangle and zeros below."""
    matrix = np.zeros((rows, columns))
    matrix[np.triu_indices(rows, 0, columns)] = np.frombuffer(base64.b64decode(text), dtype="<f8")
    return matrix


def _array(values: Sequence[Any]) -> Array:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
