"""Which effects are functions of the state is found by trying, for every family of the catalogue."""

from __future__ import annotations

import pytest

from scara_ident.effects import CATALOGUE, Effect, EffectTerm, SpectralLine
from tests.arms import ur5
from tests.effects.scenes import scene_of

pytestmark = pytest.mark.slow

# What they take besides: what came before, time, or the name of the recording.
MORE_THAN_A_STATE = {
    "presliding", "warm_up", "offset_drift", "vibration", "payload_change", "time_delay", "joint_elasticity", "backlash",
}  # fmt: skip


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: type(effect).__name__)
def test_effects_that_take_more_than_a_state_are_found_out(effect: Effect):
    scene = scene_of(ur5(), start={"m_1": 0.0, "m_2": 3.0})
    seeded = () if effect.seeded_by is None else effect.seeds(scene, 1, SpectralLine(effect.seeded_by, 3.0))
    members = [member for member in (*effect.members(scene), *seeded) if not effect.corrects_data(member)]
    for member in members[:6]:
        term = EffectTerm(effect, member, scene)
        value = [1.0] * len(term.columns)
        assert (term.state_torque(value) is None) == (effect.name in MORE_THAN_A_STATE), member
