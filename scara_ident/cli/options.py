"""Arguments and options that several commands have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperArgument, TyperCommand, TyperOption

from scara_ident.identification import ESTIMATORS
from scara_ident.memory import set_limit
from scara_ident.model import MODELS

Recordings = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORDING...",
        help="Recordings (.parquet, .csv, .mat, .npz, .h5, .mcap, .db3, a rosbag2 folder), or folders or globs of recordings.",
    ),
]
Result = Annotated[Path, typer.Argument(metavar="RESULT", help="identification.json or diagnosis.json of this arm.")]
Robot = Annotated[
    Path | None,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="robot.yaml, a URDF, or the name of a robot of example-robot-data, such as ur5; default: the embedded SCARA03.",
    ),
]
RobotOfEarlier = Annotated[
    Path | None,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="robot.yaml, a URDF, or the name of a robot of example-robot-data, such as ur5; default: the robot of --tell "
        "or --parameters, else the embedded SCARA03.",
    ),
]
RobotMoved = Annotated[
    Path | None,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="New place of the robot's URDF or robot.yaml, if it was moved; default: the place that the result names.",
    ),
]
Model = Annotated[
    str,
    typer.Option(
        "--model",
        metavar="NAME",
        callback=MODELS.check,
        autocompletion=MODELS.names,
        help="Terms of the torque equation: {models}.",
    ),
]


def _known_model(name: str | None) -> str | None:
    return None if name is None else MODELS.check(name)


ModelIfGiven = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="NAME",
        callback=_known_model,
        autocompletion=MODELS.names,
        help="Terms of the torque equation: {models}; default: complete.",
    ),
]
Method = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="NAME",
        callback=ESTIMATORS.check,
        autocompletion=ESTIMATORS.names,
        help="Estimator: {methods}. wls: each joint is weighted by its residual; ols: all rows count the same; consistent: "
        "weighted, and the parameters are physically consistent.",
    ),
]
Band = Annotated[
    float | None,
    typer.Option(
        "--band", metavar="HZ", min=1e-3, help="Low-pass cutoff for all joints; default: chosen from the data."
    ),
]
Validate = Annotated[
    list[str] | None, typer.Option("--validate", metavar="RECORDING", help="Held-out recording; may be repeated.")
]
Output = Annotated[
    Path | None, typer.Option("--output", metavar="DIR", help="Folder for the results; created if needed.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result on stdout as JSON only.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", help="Also list the contents of every file and the findings of its audit.")
]
# Limits of motions.
Ranges = Annotated[
    list[str] | None,
    typer.Option("--range", metavar="JOINT=LOWER..UPPER", help="Position limits, instead of the URDF's, rad or m."),
]
Velocities = Annotated[
    list[str] | None,
    typer.Option("--velocity", metavar="JOINT=V", help="Velocity limit, instead of the URDF's, rad/s or m/s."),
]
Accelerations = Annotated[
    list[str] | None,
    typer.Option(
        "--acceleration", metavar="JOINT=A", help="Acceleration limit, instead of robot.yaml's, rad/s^2 or m/s^2."
    ),
]
Torques = Annotated[
    list[str] | None,
    typer.Option(
        "--torque", metavar="JOINT=T", help="Torque limit, instead of the URDF's, on the recorded side, N m or N."
    ),
]
Jerks = Annotated[
    list[str] | None,
    typer.Option("--jerk", metavar="JOINT=J", help="Jerk limit, instead of robot.yaml's, rad/s^3 or m/s^3."),
]
Share = Annotated[
    float, typer.Option("--share", help="Share of every joint limit to use; it applies to limits given as options too.")
]
Floor = Annotated[
    float | None,
    typer.Option("--floor", metavar="Z", help="The tool, and links with collision shapes, stay above this height, m."),
]
Boxes = Annotated[
    list[str] | None,
    typer.Option(
        "--box",
        metavar="X,Y,Z,DX,DY,DZ",
        help="Box-shaped obstacle: centre and edge lengths in the base frame, m; may be repeated.",
    ),
]
Clearance = Annotated[
    float,
    typer.Option("--clearance", metavar="D", help="Least distance between links, and between links and obstacles, m."),
]
Tool = Annotated[str | None, typer.Option("--tool", metavar="LINK", help="Link whose origin is the tool point.")]
ToolAcceleration = Annotated[
    float | None,
    typer.Option(
        "--tool-acceleration",
        metavar="A",
        help="Limit of the tool's acceleration, m/s^2; default: 9 on the SCARA03, else no limit.",
    ),
]
ToolSpeed = Annotated[float | None, typer.Option("--tool-speed", metavar="V", help="Limit of the tool's speed, m/s.")]

Folder = Annotated[Path, typer.Option("--output", metavar="DIR", help="Folder for the results.")]

MaxMemory = Annotated[
    float | None,
    typer.Option(
        "--max-memory", metavar="GB", help="Limit of the memory for reading a file; default: half of the machine's."
    ),
]


def limited(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command with the option ``--max-memory`` beside its own, which gives the same bytes on any machine.

    The last digits of a sum depend on how many threads of BLAS share it.
    """

    @wraps(command)
    def limited(*arguments: Any, max_memory: float | None = None, **more: Any) -> Any:
        from scara_ident.cli.startup import begin_soon
        from scara_ident.processes import own_process
        from scara_ident.threads import one_blas_thread

        begin_soon()
        set_limit(max_memory)
        with one_blas_thread(), own_process():
            return command(*arguments, **more)

    # As typer finds no names of the command's module here.
    types = get_type_hints(command, include_extras=True)
    own = [each.replace(annotation=types[each.name]) for each in signature(command).parameters.values()]
    extra = Parameter("max_memory", Parameter.KEYWORD_ONLY, default=None, annotation=MaxMemory)
    return with_signature(limited, [*own, extra])


def with_signature(run: Any, parameters: Sequence[Parameter]) -> Callable[..., Any]:
    """Return a function that shows these parameters; typer asks for the signature and for the annotations."""
    run.__signature__ = Signature(parameters)
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    shown: Callable[..., Any] = run
    return shown


class Command(TyperCommand):
    """A command that refuses empty words, and whose help lists what the registries hold.

    The registries are read only for the help, because reading them takes time.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line. An empty word is refused: as a path it would mean the current folder."""
        given, _, _ = self.make_parser(ctx).parse_args(args=list(args))
        for option in self.params:
            value = given.get(option.name or "")
            if not ctx.resilient_parsing and (value == "" or (isinstance(value, list | tuple) and "" in value)):
                assert isinstance(option, TyperOption | TyperArgument)
                raise typer.BadParameter("it is empty; give a value or leave it out", ctx=ctx, param=option)
        return super().parse_args(ctx, args)

    def get_help(self, ctx: Any) -> str:
        """Return the help."""
        lists = {"{models}": MODELS, "{methods}": ESTIMATORS}
        for option in self.params:
            for word, registry in lists.items():
                if isinstance(option, TyperOption) and word in (option.help or ""):
                    option.help = str(option.help).replace(word, ", ".join(registry.names()))
        return super().get_help(ctx)
