"""The robot description file ``robot.yaml``: its keys and their checks."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    model_validator,
)

from scara_ident.errors import NoRobotError, RobotError
from scara_ident.files import foreign_letter, path_fault, real_path
from scara_ident.robot.examples import example_urdf, is_name

# Sizes that a factor of a drive or a channel may have.
MIN_FACTOR, MAX_FACTOR = 1e-12, 1e12
# Characters of a robot.yaml, and nodes of it with its aliases written out.
MAX_CHARACTERS = 1_000_000
# What the key urdf takes.
URDF = "the path of a URDF, or the name of a robot of example-robot-data"


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("expected a number other than 0")
    if not MIN_FACTOR <= abs(value) <= MAX_FACTOR:
        raise ValueError(f"expected a size between {MIN_FACTOR:g} and {MAX_FACTOR:g}")
    return value


def _no_truth_value(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("expected a number (YAML takes yes, no, on and off for truth values)")
    return value


def _number(value: Any) -> float:
    try:
        number = float(_no_truth_value(value))
    except (TypeError, ValueError, OverflowError):
        raise ValueError("expected a number") from None
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number


def _scale(value: Any) -> float:
    return _not_zero(_number(value))


def _positive(value: Any) -> float:
    number = _number(value)
    if number <= 0.0:
        raise ValueError("expected a number above 0")
    return _not_zero(number)


def _three(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError("expected three numbers in m/s^2, such as [0, 0, -9.81]")
    return value


def _urdf(value: Any) -> Any:
    if not isinstance(value, str | Path) or not str(value).strip():
        raise ValueError(f"expected {URDF}")
    return value


def _word(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError("expected a name; put it in quotes if YAML takes it for something else")
    return value.strip()


def _once_or_per_joint(check: Callable[[Any], Any]) -> PlainValidator:
    """Check one value for all joints, or a mapping from joints to values."""

    def checked(value: Any) -> Any:
        if not isinstance(value, dict):
            return check(value)
        for joint, item in value.items():
            try:
                check(item)
            except ValueError as error:
                raise ValueError(f"{joint}: {error}") from None
        return {str(joint): check(item) for joint, item in value.items()}

    return PlainValidator(checked)


Finite = Annotated[float, Field(allow_inf_nan=False, strict=False), BeforeValidator(_no_truth_value)]
NonZero = Annotated[Finite, AfterValidator(_not_zero)]
Word = Annotated[str, BeforeValidator(_word)]
UnitName = Annotated[str | dict[str, str], _once_or_per_joint(_word)]
Scale = Annotated[float | dict[str, float], _once_or_per_joint(_scale)]
Shift = Annotated[float | dict[str, float], _once_or_per_joint(_number)]
Positive = Annotated[float, PlainValidator(_positive)]
Counts = Annotated[float | dict[str, float], _once_or_per_joint(_positive)]


class JointDescription(BaseModel):
    """What the URDF cannot say of one joint."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    reduction: NonZero | None = None
    effort_gain: NonZero = 1.0
    rotor_inertia: Annotated[Finite, Field(ge=0.0, le=MAX_FACTOR)] | None = None
    acceleration_limit: Annotated[Finite, Field(gt=0.0)] | None = None
    jerk_limit: Annotated[Finite, Field(gt=0.0)] | None = None


class TimeDescription(BaseModel):
    """Where the time of a recording stands, and in which unit; else how many rows a second has."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    column: Word = "time"
    unit: Word = "s"
    rate: Positive | None = None

    @model_validator(mode="after")
    def _one_clock(self) -> TimeDescription:
        if self.rate is not None and self.model_fields_set != {"rate"}:
            raise ValueError("expected rate (of rows without a clock) or column and unit, not both")
        return self


class SignalDescription(BaseModel):
    """Where a signal of every joint stands, and what its numbers mean: scale x number + offset, in ``unit``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    column: Word | None = None
    columns: dict[str, Word] | None = None
    unit: UnitName | None = None
    scale: Scale = 1.0
    offset: Shift = 0.0

    @model_validator(mode="after")
    def _one_place(self) -> SignalDescription:
        if self.column is not None and self.columns is not None:
            raise ValueError("expected column (a pattern with {joint}) or columns (one for each joint), not both")
        return self


class MotionDescription(SignalDescription):
    """A signal of the motion, which an encoder may measure on either side of the gear."""

    side: Literal["motor", "joint"] = "joint"
    counts_per_turn: Counts | None = None


class RecordingDescription(BaseModel):
    """How the channels of the recordings are named and in which units they are."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    topic: Word | None = None
    time: TimeDescription | None = None
    position: MotionDescription | None = None
    velocity: MotionDescription | None = None
    acceleration: MotionDescription | None = None
    effort: SignalDescription | None = None
    temperature: SignalDescription | None = None
    link_position: MotionDescription | None = None


def _none_given(value: Any) -> Any:
    """A key with nothing behind it is none, as for the others."""
    return {} if value is None else value


class RobotDescription(BaseModel):
    """The contents of ``robot.yaml``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    urdf: Annotated[Path, BeforeValidator(_urdf)]
    effort_side: Literal["motor", "joint"] | None = None
    joints: dict[str, JointDescription | None] | None = None
    locked: Annotated[dict[str, Finite], BeforeValidator(_none_given)] = Field(default_factory=dict)
    gravity: Annotated[tuple[Finite, Finite, Finite], BeforeValidator(_three)] | None = None
    recording: RecordingDescription | None = None


def read_description(path: Path) -> RobotDescription:
    """Read and check a robot description.

    Parameters
    ----------
    path : Path
        The YAML file; its ``urdf`` is relative to it, or the name of a robot of example-robot-data.

    Raises
    ------
    RobotError
        In one line: file, key and what was expected.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """Says where a scalar stands that is none: a date without such a month, an integer of thousands of digits."""

        def construct_object(self, node: Any, deep: bool = False) -> Any:
            try:
                return super().construct_object(node, deep)
            except ValueError as error:
                said = f"{node.value[:20]!r} cannot be read ({str(error).partition(';')[0]}); correct it, or put it in quotes"
                raise yaml.constructor.ConstructorError(None, None, said, node.start_mark) from None

    if (fault := path_fault(path)) is not None:
        raise RobotError(fault)
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(MAX_CHARACTERS + 1)
        if len(text) > MAX_CHARACTERS:
            raise RobotError(
                f"{path}: more than {MAX_CHARACTERS} characters; a robot.yaml has a few lines for each joint"
            )
        tree = yaml.compose(text, Loader=yaml.SafeLoader)
        if _size(tree, {}) > MAX_CHARACTERS:
            raise RobotError(f"{path}: aliases (*name) of aliases, which unfold without end; write the values out")
        _refuse_twice(tree, path)
        content: Any = yaml.load(text, Loader=Loader)
    except FileNotFoundError:
        raise NoRobotError(f"{path}: no such robot description") from None
    except IsADirectoryError:
        raise RobotError(f"{path}: is a folder; give its robot.yaml") from None
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RobotError(f"{path}{_not_utf_8(path)}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        reason = " ".join(str(getattr(error, "problem", error)).split())
        raise RobotError(f"{path}{where}: not YAML: {reason}") from None
    except RecursionError:
        raise RobotError(f"{path}: nested too deeply; a robot.yaml has a few levels") from None
    description = check_description(content, path)
    # What lies beside the file comes before a robot of that name.
    named = is_name(description.urdf, path.parent)
    try:
        urdf = example_urdf(description.urdf.name) if named else path.parent / description.urdf
    except NoRobotError as error:
        raise RobotError(f"{path}: urdf: {error}") from None
    return description.model_copy(update={"urdf": real_path(urdf)})


def _not_utf_8(path: Path) -> str:
    """Say which letter of a file is in another encoding, and where; that it is no text where it has bytes that no text has."""
    with path.open("rb") as file:
        letter = foreign_letter(file.read(MAX_CHARACTERS))
    return f", {letter}" if letter else ": not a text file in UTF-8; expected a robot.yaml"


def _size(node: Any, known: dict[int, float]) -> float:
    """Return how many nodes a YAML tree has once its aliases are written out; infinite where one holds itself."""
    if id(node) not in known:
        known[id(node)] = math.inf
        parts = node.value if isinstance(getattr(node, "value", None), list) else []
        inner = [part for item in parts for part in (item if isinstance(item, tuple) else (item,))]
        known[id(node)] = 1.0 + sum(_size(part, known) for part in inner)
    return known[id(node)]


def _refuse_twice(node: Any, path: Path, above: str = "") -> None:
    """Refuse a key that stands twice in a mapping: YAML's reader would take the last without a word."""
    if not isinstance(getattr(node, "value", None), list):
        return
    seen: set[str] = set()
    for item in node.value:
        if not isinstance(item, tuple):
            _refuse_twice(item, path, above)
            continue
        key, value = item
        name = f"{above}{key.value}"
        if name in seen:
            line = key.start_mark.line + 1
            raise RobotError(f"{path}, line {line}: {name}: is here twice; keep one of them")
        seen.add(name)
        _refuse_twice(value, path, f"{name}.")


def check_description(content: Any, path: Path) -> RobotDescription:
    """Check the contents of a robot description; ``path`` is named in errors.

    Raises
    ------
    RobotError
        In one line: file, key and what was expected.
    """
    if not isinstance(content, dict):
        raise RobotError(f"{path}: expected a mapping with the key urdf, found {type(content).__name__}")
    try:
        return RobotDescription.model_validate(content)
    except ValidationError as error:
        raise RobotError(f"{path}: {_first_problem(error)}") from None


def _first_problem(error: ValidationError) -> str:
    problem = error.errors()[0]
    key = ".".join(str(part) for part in problem["loc"] if part not in ("[key]",))
    kind = problem["type"]
    if kind == "extra_forbidden":
        owner = _owner(problem["loc"])
        return f"{key}: unknown key; expected one of {', '.join(owner.model_fields)}"
    if kind == "missing":
        return f"{key}: missing; expected {URDF}"
    message = problem["msg"].removeprefix("Value error, ")
    return f"{key}: {message[0].lower()}{message[1:]}; found {_short(problem['input'])}"


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        # An integer of more digits than Python writes out.
        return f"a long {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:80]}..."


def _owner(location: tuple[int | str, ...]) -> type[BaseModel]:
    """Return the model in which the last key of a location was sought."""
    first, *rest = location
    if first == "joints":
        return JointDescription
    if first != "recording" or not rest:
        return RobotDescription
    if len(rest) == 1:
        return RecordingDescription
    if rest[0] == "time":
        return TimeDescription
    return SignalDescription if rest[0] in ("effort", "temperature") else MotionDescription
