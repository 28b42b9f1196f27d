"""Effects that the motion cannot tell apart are named together, and only those."""

from __future__ import annotations

from scara_ident.diagnosis.confounding import rivals
from scara_ident.diagnosis.search import search
from scara_ident.effects.friction import AsymmetricFriction
from scara_ident.effects.position import Spring
from scara_ident.effects.tilt import BaseTilt, NominalBaseTilt
from scara_ident.recording import Recording
from tests.diagnosis.made import BANDS, complete, virtual_runs

CATALOGUE = (Spring(), BaseTilt(), NominalBaseTilt(), AsymmetricFriction())


def groups(recordings: tuple[Recording, ...]) -> dict[str, set[str]]:
    """Each effect found with its rivals."""
    result = search(complete(), recordings, BANDS, catalogue=CATALOGUE)
    last = result.steps[-1].estimate
    found = rivals(result, last.weights)
    for item, others in zip(result.chosen, found, strict=True):
        assert all(rival.gain > 0.5 * rival.found_gain for rival in others)
        assert item.label(result.scene) not in {rival.label for rival in others}
    return {
        item.effect.name: {rival.effect for rival in others} for item, others in zip(result.chosen, found, strict=True)
    }


def test_a_spring_and_a_tilt_are_one_on_a_small_range():
    found = groups(virtual_runs("spring:joint1:stiffness=0.4,rest_position=0.8", size=0.2))
    (name,) = found
    assert {name, *found[name]} == {"spring", "base_tilt"}


def test_on_a_large_range_the_spring_stands_alone():
    assert groups(virtual_runs("spring:joint1")) == {"spring": set()}


def test_an_effect_of_another_kind_is_no_rival():
    found = groups(virtual_runs("asymmetric_friction:joint2"))
    assert found == {"asymmetric_friction": set()}
