"""The reduction to base parameters as text."""

from __future__ import annotations

from typing import Any

from scara_ident.model.base_parameters import check_base_parameters
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.model.urdf_values import urdf_base_values
from scara_ident.robot.robot import Robot


def base_dict(robot: Robot) -> dict[str, Any]:
    """Return the content of ``base.json``."""
    term = rigid_body(robot)
    base = term.base
    check = check_base_parameters(robot, base)
    names = base.standard_names
    stated = urdf_base_values(robot, term)
    return {
        "robot": robot.name,
        "bodies": [
            {"number": i + 1, "joint": robot.joints[i], "link": robot.links[i], "reduction": robot.reduction[i]}
            for i in range(robot.n)
        ],
        "count": base.count,
        "base_parameters": [
            {
                "name": column.name,
                "joint": column.joint,
                "unit": column.unit,
                "urdf": stated[k],
                "expression": base.expression(k),
                "made_of": {names[i]: base.grouping[k, i] for i in range(len(names)) if base.grouping[k, i] != 0.0},
            }
            for k, column in enumerate(term.columns)
        ],
        "never_enter": [names[i] for i in base.absent],
        "only_in_sums": [names[i] for i in base.only_in_sums()],
        "approximate": [{"name": names[i], "share": share} for i, share in base.approximate],
        "check": {key: getattr(check, key) for key in ("rank", "torque_error", "null_error", "passed")},
    }
