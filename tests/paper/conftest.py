"""Fixtures of the tests beside."""

from __future__ import annotations

import pinocchio as pin
import pytest

from scara_ident import paper
from tests.paper.made import URDF


@pytest.fixture(scope="session")
def arm() -> pin.Model:
    model = pin.buildModelFromUrdf(str(URDF))
    return pin.buildReducedModel(model, [model.getJointId("joint3")], pin.neutral(model))


@pytest.fixture(scope="session")
def report() -> paper.PaperReport:
    return paper.check_paper()
