"""Joints that stand between their moves: what is not smooth where they set out is no elastic joint and no delay."""

from __future__ import annotations

from pathlib import Path

import pytest

from scara_ident.diagnosis.diagnose import diagnose

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.parametrize("seed", [644100003, 644100024])
def test_an_arm_whose_joints_stick_lacks_nothing(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Friction is most of its torque, so that bands are narrow: a stiffness of 209 ± 11 and one of 290 ± 8 N m/rad were found."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    sets = pytest.importorskip("virtual_sets", reason="benchmarks are not part of an installed package")
    made = sets.simulate_set("none", seed, "asr_twodof", tmp_path, sets.Asked(varied=False))
    found = diagnose(made.robot, made.training, validation=made.held_out)
    assert not found.effects
    assert found.verdict in ("complete", "undecided")
