from __future__ import annotations

import pytest

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.options import ConsistentOptions


@pytest.mark.parametrize(
    "options",
    [
        {"friction": "slippery"},
        {"friction": {"joint1": "slippery"}},
        {"com": "inside"},
        {"prior_weight": 0.0},
        {"total_mass": (3.0, 0.0)},
        {"priors": {"P_d1": (1.0, 0.0)}},
        {"speed": {"joint1": -1.0}},
    ],
)
def test_options_without_a_meaning_are_refused(options):
    with pytest.raises(UsageError):
        ConsistentOptions(**options)
