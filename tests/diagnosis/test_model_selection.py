"""Which band can tell, and which effects are worth their name."""

from __future__ import annotations

from scara_ident.diagnosis.model_selection import LEAST_OF_REPEATABLE, Task, joint_rms, outcome_of
from scara_ident.diagnosis.search import search
from scara_ident.effects import CATALOGUE
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import AsymmetricFriction, FrictionCoupling
from scara_ident.effects.periodic import Vibration
from scara_ident.effects.presliding import Presliding
from scara_ident.estimation.bands import choose_bands
from tests.diagnosis.made import complete, virtual_runs

MODEL = complete()


def task(runs, *catalogue) -> Task:
    return Task(MODEL, tuple(runs), catalogue or CATALOGUE, lambda step: None)


def found(outcome) -> set[str]:
    return {item.label(outcome.search.scene) for item in outcome.search.chosen}


def widest(runs) -> tuple[float, float]:
    return (max(choose_bands(MODEL, runs).bands),) * 2


def test_a_joint_that_swings_within_the_band_is_found_below_it() -> None:
    runs = virtual_runs("joint_elasticity:joint1:stiffness=20000")
    bands = widest(runs)
    outcome = outcome_of(task(runs, JointElasticity(), AsymmetricFriction()), bands, free=True)
    assert found(outcome) == {"joint_elasticity of joint1"}
    (band, _) = outcome.search.bands
    assert band is not None
    assert band < 0.8 * bands[0]
    # The band that was asked for is kept.
    kept = outcome_of(task(runs, JointElasticity(), AsymmetricFriction()), bands, free=False)
    assert kept.search.bands == bands


def test_what_was_found_shows_that_the_band_is_wider() -> None:
    runs = virtual_runs("presliding:joint1:presliding_distance=0.0075", "vibration:joint2:amplitude=0.02")
    outcome = outcome_of(task(runs, Presliding(), Vibration()), (4.0, 4.0), free=True)
    assert found(outcome) == {"presliding of joint1", "vibration of joint2"}
    assert max(band or 0.0 for band in outcome.search.bands) > 6.0


def test_an_effect_that_stands_for_one_outside_the_catalogue_is_not_counted() -> None:
    runs = virtual_runs("unlisted_2:joint2:viscous=0.02")
    bands = widest(runs)
    outcome = outcome_of(task(runs), bands, free=False)
    assert outcome.unexplained is not None
    assert outcome.unexplained.joint == "joint2"
    assert found(outcome) == set()
    # Something did help, and is named with the share that it would have removed.
    first = search(MODEL, runs, bands)
    (proxy,) = {item.label(first.scene) for item in first.chosen}
    (words,) = outcome.demoted
    assert words.startswith(f"{proxy} is not counted: it would remove ")
    before, after = (
        joint_rms(fit.value, evidence)[1]
        for fit, evidence in ((first.start, first.start_evidence), (first.steps[-1].estimate, first.steps[-1].evidence))
    )
    assert before is not None
    assert after is not None
    noise = outcome.fit_after[1].noise
    share = (before**2 - after**2) / (before**2 - noise**2)
    assert share < LEAST_OF_REPEATABLE
    assert abs(float(words.split("remove ")[1].split("%")[0]) - 100.0 * share) < 2.0


def test_nothing_is_demoted_where_the_rest_is_noise() -> None:
    runs = virtual_runs("asymmetric_friction:joint1:viscous_difference=0.03")
    outcome = outcome_of(task(runs, AsymmetricFriction(), FrictionCoupling()), (11.0, 11.0), free=False)
    assert found(outcome) == {"asymmetric_friction of joint1"}
    assert outcome.unexplained is None
    assert outcome.demoted == ()
