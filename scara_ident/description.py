"""The robot description file ``robot.yaml``: its keys and their checks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from scara_ident.errors import RobotError


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("expected a number other than 0")
    return value


def _no_truth_value(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("expected a number (YAML takes yes, no, on and off for truth values)")
    return value


Finite = Annotated[float, Field(allow_inf_nan=False, strict=False), BeforeValidator(_no_truth_value)]
NonZero = Annotated[Finite, AfterValidator(_not_zero)]


class JointDescription(BaseModel):
    """What the URDF cannot say of one joint."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    reduction: NonZero | None = None
    effort_gain: NonZero = 1.0
    rotor_inertia: Annotated[Finite, Field(ge=0.0)] | None = None


class RobotDescription(BaseModel):
    """The contents of ``robot.yaml``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    urdf: Path
    effort_side: Literal["motor", "joint"] | None = None
    joints: dict[str, JointDescription | None] | None = None
    locked: dict[str, Finite] = Field(default_factory=dict)
    gravity: tuple[Finite, Finite, Finite] | None = None


def read_description(path: Path) -> RobotDescription:
    """Read and check a robot description.

    Parameters
    ----------
    path : Path
        The YAML file; its ``urdf`` is relative to it.

    Raises
    ------
    RobotError
        In one line: file, key and what was expected.
    """
    import yaml

    try:
        content: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RobotError(f"{path}: no such robot description") from None
    except IsADirectoryError:
        raise RobotError(f"{path}: is a folder; give its robot.yaml") from None
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RobotError(f"{path}: not a text file; expected a robot.yaml") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        reason = " ".join(str(getattr(error, "problem", error)).split())
        raise RobotError(f"{path}{where}: not YAML: {reason}") from None
    if not isinstance(content, dict):
        raise RobotError(f"{path}: expected a mapping with the key urdf, found {type(content).__name__}")
    try:
        description = RobotDescription.model_validate(content)
    except ValidationError as error:
        raise RobotError(f"{path}: {_first_problem(error)}") from None
    return description.model_copy(update={"urdf": (path.parent / description.urdf).resolve()})


def _first_problem(error: ValidationError) -> str:
    problem = error.errors()[0]
    key = ".".join(str(part) for part in problem["loc"] if part not in ("[key]",))
    kind = problem["type"]
    if kind == "extra_forbidden":
        owner = JointDescription if key.startswith("joints.") else RobotDescription
        return f"{key}: unknown key; expected one of {', '.join(owner.model_fields)}"
    if kind == "missing":
        return f"{key}: missing"
    message = problem["msg"].removeprefix("Value error, ")
    return f"{key}: {message[0].lower()}{message[1:]}; found {problem['input']!r}"
