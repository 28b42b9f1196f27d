"""An identified model as one C header without dependencies, for C99 and C++."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain

from scara_ident.export.code import Language, code_lines, inputs_of
from scara_ident.export.traced_model import TracedModel
from scara_ident.model.regressor.tracing import ABS, COS, EXP, SIGN, SIN, TANH, Scalar

_HEAD = """\
/* Inverse dynamics of {robot}, by scara-ident.

{about}

   Joints, in this order, and the unit of their torques:
{joints}

   {low}_torque(q, v, a, out)    out[n]     the torque as it was recorded, mass * a + bias + friction
   {low}_mass(q, out)            out[n * n] row by row: recorded torque of each joint per acceleration of each
   {low}_bias(q, v, out)         out[n]     Coriolis, centrifugal and gravity torque of the links
   {low}_friction(q, v, a, out)  out[n]     all else: friction, offset, effects

   Angles in rad, lengths in m, time in s. Divide a torque by its gain to command what was recorded. `out` may be one of
   the inputs. Nothing is allocated or kept; the only branch on data is the sign of a velocity. Define
   {up}_FLOAT before the first inclusion for float instead of double. */
#ifndef {up}_DYNAMICS_H
#define {up}_DYNAMICS_H

#include <math.h>

#ifdef {up}_FLOAT
typedef float {low}_real;
#define {up}_OF(function) function##f
#else
typedef double {low}_real;
#define {up}_OF(function) function
#endif
#define {up}_JOINTS {n}

static inline {low}_real {low}_sign({low}_real x) {{ return ({low}_real)((x > 0) - (x < 0)); }}
"""
_FUNCTION = """
static inline void {low}_{name}({arguments}, {low}_real *out)
{{
{body}
}}
"""
_FOOT = """
#undef {up}_OF
#endif
"""


def c_name(robot: str) -> str:
    """Return a robot's name as the beginning of names in C."""
    name = re.sub(r"\W+", "_", robot, flags=re.ASCII).strip("_").lower()
    return f"arm_{name}" if not name or name[0].isdigit() else name


def c_header(model: TracedModel, about: Sequence[str] = ()) -> str:
    """Write a model as a C header.

    Parameters
    ----------
    about : sequence of str, optional
        What the reader of the file should know, one line each.
    """
    robot, low = model.robot, c_name(model.robot.name)
    up = low.upper()
    real = f"(({low}_real)"
    language = Language(
        f"    const {low}_real {{name}} = {{value}};",
        "    out[{place}] = {value};",
        {SIGN: f"{low}_sign({{x}})"}
        | {
            key: f"{up}_OF({word})({{x}})"
            for key, word in ((SIN, "sin"), (COS, "cos"), (ABS, "fabs"), (EXP, "exp"), (TANH, "tanh"))
        },
        lambda value: f"{real}{value!r})",
    )  # fmt: skip
    joints = [
        f"     {k}  {name}  [{robot.torque_unit(k)}], {robot.effort_side} side, gain {gain:.10g}"
        for k, (name, gain) in enumerate(zip(robot.joints, robot.effort_gain, strict=True))
    ]
    plain = [line.replace("*/", "* /") for line in about]
    words = {"robot": robot.name.replace("*/", "* /"), "low": low, "up": up, "n": str(robot.n)}
    text = _HEAD.format(about="\n".join(f"   {line}" for line in plain), joints="\n".join(joints), **words)
    parts: tuple[tuple[str, str, Sequence[Scalar]], ...] = (
        ("torque", "qva", model.torque),
        ("mass", "q", tuple(chain.from_iterable(model.mass))),
        ("bias", "qv", model.bias),
        ("friction", "qva", model.friction),
    )
    for name, letters, outputs in parts:
        used = inputs_of(model.trace, outputs, robot.n)
        unused = [f"    (void){letter};" for letter in letters if letter not in used]
        text += _FUNCTION.format(
            name=name,
            low=low,
            arguments=", ".join(f"const {low}_real *{letter}" for letter in letters),
            body="\n".join([*unused, *code_lines(model.trace, outputs, language, robot.n)]),
        )
    return text + _FOOT.format(up=up)
