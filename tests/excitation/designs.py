"""Short designs for the SCARA03."""

import pytest

from scara_ident.excitation import Effort, tell
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

SCARA = load_robot()


COMPLETE = build_model(SCARA)


QUICK = Effort(starts=1, rounds=0, processes=1)


SHORT = {"duration": 4.0, "harmonics": 6, "samples": 400}


def hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let searches for what tells look at few motions, where how much theirs tells plays no part."""
    for name, fewer in (("DRAWN", 12), ("CHANGED", 15), ("PACES", (1.0,))):
        monkeypatch.setattr(tell, name, fewer)
