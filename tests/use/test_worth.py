"""What effects are worth, and why where that cannot be told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scara_ident.errors import UsageError
from scara_ident.report.use import worth_dict
from scara_ident.use.worth import worth
from tests.use.made import with_spring


def test_where_no_arm_has_the_effects_that_is_said_in_a_line() -> None:
    coupling = {"effect": "drive_coupling", "joint": "joint2", "parameters": {"share": {"value": 0.2, "std": 0.01}}}
    model = replace(with_spring(), found=(coupling,))
    with pytest.raises(UsageError, match="the virtual arm has none of the effects found: drive_coupling"):
        worth(model)
    told = worth_dict(model)
    assert told["tracking"] is None
    assert told["summary"] == [f"What the effects cost is not known: {told['why']}."]
