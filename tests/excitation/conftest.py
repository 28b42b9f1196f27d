"""Fixtures of the tests beside."""

import pytest

from scara_ident.excitation import (
    Effort,
    design_excitation,
)
from tests.excitation.designs import COMPLETE, SHORT


@pytest.fixture(scope="session")
def short():
    return design_excitation(COMPLETE, **SHORT, effort=Effort(starts=2, rounds=0, seed=3, processes=1))
