"""The benchmark that repeats the paper's campaign on the virtual arm: its tables, its conclusions, a tiny run."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import spearmanr

from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.paper import REDUCED, TRAJECTORIES
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import CATALOGUE

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def campaign(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return pytest.importorskip("campaign", reason="benchmarks are not part of an installed package")


def test_every_conclusion_of_the_paper_follows_from_its_own_tables(campaign: ModuleType) -> None:
    found = campaign.conclusions(campaign.printed(), list(TRAJECTORIES))
    assert [item.name for item in found if not item.holds] == []
    assert len(found) == 7


def test_conclusions_fail_where_trajectories_do_not_differ(campaign: ModuleType) -> None:
    from dataclasses import replace

    paper = campaign.printed()
    same = replace(paper, complete=np.ones((5, 5, 2)), reduced=np.ones((5, 5, 2)), parameters=np.ones((10, 5)))
    holds = {item.name: item.holds for item in campaign.conclusions(same, list(TRAJECTORIES))}
    assert not holds["the reduced model extrapolates better"]
    assert not holds["bad trajectories estimate a negative I_2z"]
    assert not holds["the reduced model fits its own trajectory slightly worse"]


def test_rank_correlation_is_spearmans_and_its_p_the_share_of_orders(campaign: ModuleType) -> None:
    import campaign_tables

    rng = np.random.default_rng(3)
    x, y = rng.normal(size=5), rng.normal(size=5)
    rho, p = campaign_tables.rank_correlation(x, y, -1.0)
    assert rho == pytest.approx(spearmanr(x, y).statistic)
    assert 1.0 / 120.0 <= p <= 1.0
    assert campaign_tables.rank_correlation(x, -x, -1.0) == (pytest.approx(-1.0), pytest.approx(1.0 / 120.0))


def test_printed_tables_are_at_distance_zero_and_a_factor_ten_at_one(campaign: ModuleType) -> None:
    from dataclasses import replace

    paper = campaign.printed()
    assert max(float(value) for value in campaign.distances(paper, paper).values()) == 0.0
    far = replace(paper, complete=10.0 * paper.complete, reduced=10.0 * paper.reduced)
    assert float(campaign.distances(far, paper)["both"]) == pytest.approx(1.0)
    level = replace(paper, parameters=np.repeat(paper.parameters[:, -1:], 5, axis=1))
    assert float(campaign.distances(level, paper)["table5"]) == pytest.approx(1.0)


def test_drawn_noise_spreads_parameters_as_least_squares_on_2500_samples(campaign: ModuleType) -> None:
    model = build_model(load_robot(), "complete")
    rng, size, rows = np.random.default_rng(1), len(model.columns), 5000
    regressors = [rng.normal(size=(rows, size)) for _ in range(2)]
    item = [Information.empty(size).absorb(w, w @ np.ones(size)) for w in regressors]
    sigma = np.array([[0.5, 0.1]])
    tables = campaign.drawn_tables([item], sigma, rng.standard_normal((4000, 1, 2, size)))
    kept = [model.names.index(name) for name in REDUCED]
    # Only 2500 of these 5000 samples count: the covariance is twice that of all.
    inverse = np.linalg.pinv(np.vstack([w[:, kept] for w in regressors]))
    noise = np.repeat(sigma[0] ** 2, rows)
    expected = np.sqrt(2.0 * np.einsum("pn,n,pn->p", inverse, noise, inverse))
    assert np.std(tables.parameters[:, :, 0], axis=0) == pytest.approx(expected, rel=0.06)
    assert tables.complete[:, 0, 0] == pytest.approx(np.tile(sigma[0], (4000, 1)))


def test_sizes_cover_every_effect_of_the_catalogue_and_its_joints(campaign: ModuleType) -> None:
    import campaign_effects

    arm = campaign.virtual_arm()
    assert set(campaign_effects.SIZE) == {kind.name for kind in CATALOGUE}
    for kind in CATALOGUE:
        one, three = (campaign.sized(arm, kind, factor) for factor in (1.0, 3.0))
        assert one == tuple(kind(joint=effect.joint).resolve(arm) for effect in one)
        assert all(a != b for a, b in zip(three, one, strict=True))
    warm_up = next(kind for kind in CATALOGUE if kind.name == "warm_up")
    assert not campaign_effects.can_be(arm, warm_up, -5.0)


@pytest.mark.slow
def test_a_tiny_campaign_runs_and_a_strong_effect_changes_the_tables(campaign: ModuleType) -> None:
    kinds = [kind for kind in CATALOGUE if kind.name == "time_delay"]
    names = ("L2", "L1")
    content = campaign.run(kinds, names, count=1, sizes=1, refined=0, filters=())
    assert content["chosen"] == "time_delay x -3"
    scenes = {item["name"]: item["one_run"] for item in content["scan"]}
    assert scenes["time_delay"]["distance"]["both"] != scenes["none"]["distance"]["both"]
    without, delayed = (np.array(run["complete"]) for run in content["campaigns"].values())
    # L2's parameters from a torque 12 ms early predict L1 worse.
    assert delayed[1, 0, 0] > 2.0 * without[1, 0, 0]
    # On their own trajectory OLS parameters leave Table 1's noise and what encoder steps stir up, a third of it at 14 Hz at the
    # most: the power of an acceleration's noise grows with the fifth power of the band.
    share = np.diagonal(without).T / campaign.sigma_of(names)
    bands = np.array(content["campaigns"]["no effect"]["bands"])
    assert np.all(share > 0.97)
    assert np.all(share**2 - 1.0 < 0.33 * (bands / 14.0) ** 5)


@pytest.mark.slow
def test_encoder_steps_alone_make_the_inertia_of_l2_negative(campaign: ModuleType) -> None:
    from dataclasses import replace

    arm = campaign.virtual_arm()
    model = build_model(arm.robot, "reduced")
    found = {}
    for steps in (0.0, 2000.0):
        runs = campaign.repetitions(replace(arm, encoder_steps=np.full(2, steps)), ["L2"], (), 1, noisy=False)
        rows = campaign.unfiltered(observe(model, prepare(runs, (13.7, 10.9))))
        found[steps] = merge(rows).solve().value[model.names.index("P_d4")]
    # Table 5, column OJD, is what the arm is made of.
    assert found[0.0] == pytest.approx(0.758, rel=0.03)
    assert found[2000.0] < -0.5
