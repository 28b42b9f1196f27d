"""Candidates by name, and their columns against those of the model that has them as terms."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident import processes
from scara_ident.diagnosis.candidates.candidates import WORTH_A_PROCESS, Candidate, CandidateColumns, with_columns
from scara_ident.diagnosis.selection.search import scene_of as scene_on
from scara_ident.diagnosis.testing.selection_step import together_of
from scara_ident.effects import CATALOGUE, Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.friction import FrictionCoupling, Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.position import Spring
from scara_ident.effects.signals import ModelledEffect
from scara_ident.effects.tilt import BaseTilt
from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import stretches
from scara_ident.motion.position_noise import noisier
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import exact_runs, observed
from tests.effects.scenes import scene_of

ROBOT = load_robot()
SCENE = scene_of(ROBOT)


def test_a_candidate_is_called_by_effect_and_joints():
    assert Candidate(Stribeck(), Member(1, (0.1,))).label(SCENE) == "stribeck of joint2"
    assert Candidate(BaseTilt(), Member(None)).label(SCENE) == "base_tilt"
    coupling = next(item for item in FrictionCoupling().members(SCENE) if item.joint == 0)
    assert Candidate(FrictionCoupling(), coupling).label(SCENE) == "friction_coupling of joint1 by joint2"


def test_other_nonlinear_parameters_change_neither_joint_nor_label():
    one = Candidate(Stribeck(), Member(1, (0.1,)))
    other = one.at([np.float64(0.2)])
    assert other.member.nonlinear == (0.2,)
    assert type(other.member.nonlinear[0]) is float
    assert (other.joint(SCENE), other.label(SCENE)) == ("joint2", one.label(SCENE))


def test_members_of_the_catalogue_that_differ_in_more_than_these_have_their_own_labels():
    kinds: dict[str, set] = {}
    for effect in CATALOGUE:
        for member in effect.members(SCENE):
            label = Candidate(effect, member).label(SCENE)
            kinds.setdefault(label, set()).add((effect.name, member.joint))
    assert all(len(kind) == 1 for kind in kinds.values())
    assert len(kinds) > 20


@pytest.fixture(scope="module")
def gapped() -> Observations:
    """Recordings of which one has gaps, and between two of them too little to use."""
    first, *others = exact_runs()[:3]
    kept = np.ones(len(first.time), dtype=bool)
    kept[1000:1010] = kept[1030:1040] = False
    cut = replace(first, time=first.time[kept], position=first.position[:, kept], effort=first.effort[:, kept])
    assert len(stretches(cut)) == 3
    found = observed([cut, *others])
    assert [part.usable for part in found.data.stretches[:3]] == [True, False, True]
    return found


def test_columns_of_the_catalogue_are_those_of_the_model_with_them_as_terms(gapped: Observations):
    scene = scene_on(gapped.model, wls(gapped).value, gapped)
    candidates = [Candidate(effect, member) for effect in CATALOGUE for member in effect.members(scene)[:2]]
    assert len(candidates) > 30
    columns = CandidateColumns(gapped)
    joints = with_columns(gapped, columns.rows(scene, candidates))
    terms = tuple(item.term(scene) for item in candidates)
    wide = observe(TorqueModel("wide", ROBOT, (*gapped.model.terms, *terms)), gapped.data)
    for one, other in zip(joints, wide.joints, strict=True):
        assert_array_equal(one.columns, other.columns)
        assert_array_equal(one.starts, other.starts)
        assert_array_equal(one.counts, other.counts)
        size = np.maximum(np.max(np.abs(other.table), axis=1, keepdims=True), 1e-12)
        assert_allclose(one.table / size, other.table / size, rtol=0, atol=1e-12)


def test_columns_and_slopes_of_what_is_smooth_are_those_of_all_samples(monkeypatch: pytest.MonkeyPatch):
    # Rows of 16 samples each, of which two are as good as one.
    seen = observed(exact_runs()[:2], (6.2, 6.2))
    assert [part.decimation for part in seen.data.stretches] == [2, 2]
    scene = scene_on(seen.model, wls(seen).value, seen)
    ends = [list(pairwise(np.cumsum([0, *(len(part.kept[j]) for part in seen.data.stretches)]))) for j in range(2)]
    # From well within the band to where the highest is tried, and two that act together.
    for chosen in (
        [Candidate(JointElasticity(), Member(1, (4.0, 0.05)))],
        [Candidate(JointElasticity(), Member(0, (24.0, 0.2)))],
        [Candidate(JointElasticity(), Member(j, (10.0, 0.2))) for j in (0, 1)],
    ):
        given = replace(scene, together=together_of(chosen))
        few = CandidateColumns(seen)
        rows, slopes = few.rows(given, chosen), [few.slopes(given, item) for item in chosen]
        with monkeypatch.context() as patch:
            patch.setattr(JointElasticity, "smooth", False)
            full = CandidateColumns(seen)
            wanted = full.rows(given, chosen)
            expected = [full.slopes(given, item) for item in chosen]
            # At every sample they are given as they are.
            raw = full.raw(given, chosen)
        pairs = [(one, other, 0.01) for one, other in zip(rows, wanted, strict=True)]
        # A fit goes by its derivatives, and ends where the columns themselves say.
        pairs += [(one, other, 0.1) for one, other in zip(slopes, expected, strict=True)]
        for one, other, least in pairs:
            assert one.keys() == other.keys()
            for joint in one:
                # Both filters continue what they have from the first sample and the last, for which they have not the same, and how
                # a link swung at the beginning is read from the noise there: without damping for long.
                inner = np.concatenate([np.arange(a + 12, b - 12) for a, b in ends[joint]])
                size = np.sqrt(np.mean(other[joint][:, inner] ** 2, axis=1))
                apart = np.sqrt(np.mean((one[joint] - other[joint])[:, inner] ** 2, axis=1))
                assert np.all(apart <= least * size + 1e-3 * least * np.max(size))
        for one, other in zip(few.raw(given, chosen), raw, strict=True):
            for part, same in zip(one, other, strict=True):
                assert all(np.array_equal(part[joint], same[joint]) for joint in same)
        # Asked for at every sample, those within the band stay what they are.
        again = few.rows(given, chosen)
        assert all(np.array_equal(a[joint], b[joint]) for a, b in zip(again, rows, strict=True) for joint in b)


def test_a_model_of_nothing_but_bodies_has_nothing_that_jumps():
    whole = observed(exact_runs()[:1], (6.2, 6.2))
    bodies = TorqueModel("bodies", ROBOT, (whole.model.rigid_body,))
    seen = observe(bodies, whole.data)
    scene = scene_on(bodies, wls(seen).value, seen)
    assert whole.data.stretches[0].decimation == 2
    (rows,) = CandidateColumns(seen).rows(scene, [Candidate(JointElasticity(), Member(1, (10.0, 0.2)))])
    assert all(np.all(np.isfinite(own)) and np.any(own) for own in rows.values())


def test_the_predicted_torque_is_that_of_the_model_with_them_as_terms(gapped: Observations):
    value = wls(gapped).value
    scene = scene_on(gapped.model, value, gapped)
    chosen = [Candidate(Spring(), Member(0)), Candidate(TransmissionLoss(), Member(1, (0.1,)))]
    model = TorqueModel("wide", ROBOT, (*gapped.model.terms, *(item.term(scene) for item in chosen)))
    given = np.concatenate([value, np.linspace(0.1, 0.2, len(model.columns) - len(value))])
    told = CandidateColumns(gapped).predicted(scene, chosen, given)
    assert len(told) == len(gapped.data.stretches)
    for torque, part in zip(told, gapped.data.stretches, strict=True):
        assert_allclose(torque, np.einsum("npk,p->nk", model.regressor(part.motion), given), atol=1e-12)


def test_columns_are_made_once_and_again_only_where_they_follow_the_estimate(monkeypatch: pytest.MonkeyPatch):
    seen = observed(exact_runs()[:2])
    scene = scene_on(seen.model, wls(seen).value, seen)
    other = replace(scene, value=1.1 * scene.value)
    made = []
    for effect in (Stribeck, TransmissionLoss):
        whole = effect.by_joint
        monkeypatch.setattr(
            effect, "by_joint", lambda *given, name=effect.name, whole=whole: made.append(name) or whole(*given)
        )
    columns = CandidateColumns(seen)
    candidates = [Candidate(Stribeck(), Member(1, (0.1,))), Candidate(TransmissionLoss(), Member(1, (0.1,)))]
    first = columns.rows(scene, candidates)
    again = columns.rows(scene, candidates)
    assert sorted(made) == ["stribeck"] * 2 + ["transmission_loss"] * 2
    assert all(one is same for one, same in zip(first, again, strict=True))
    later = columns.rows(other, candidates)
    assert sorted(made[4:]) == ["transmission_loss"] * 2
    assert later[0] is first[0]
    assert np.max(np.abs(later[1][1] - first[1][1])) > 0.0
    columns.forget_all_but(scene)
    assert columns.rows(scene, candidates)[1] is first[1]
    assert len(made) == 6
    columns.rows(other, candidates)
    assert len(made) == 8
    # Beside another torque the motion is the same, and so are the columns.
    assert columns.beside(seen).rows(scene, candidates)[0] is first[0]


def test_columns_of_a_load_are_made_again_where_what_acts_on_links_is_another(monkeypatch: pytest.MonkeyPatch):
    seen = observed(exact_runs()[:1])
    scene = scene_on(seen.model, wls(seen).value, seen)
    held = replace(scene, link_torques=(ModelledEffect(Spring(), Member(1), (0.5,)),))
    made = []
    for effect in (BaseTilt, TransmissionLoss):
        whole = effect.by_joint
        monkeypatch.setattr(
            effect, "by_joint", lambda *given, name=effect.name, whole=whole: made.append(name) or whole(*given)
        )
    columns = CandidateColumns(seen)
    candidates = [Candidate(BaseTilt(), Member(None)), Candidate(TransmissionLoss(), Member(1, (0.1,)))]
    first = columns.rows(scene, candidates)
    later = columns.rows(held, candidates)
    again = columns.rows(replace(held, travel=2.0 * held.travel), candidates)
    assert made == ["base_tilt", "transmission_loss", "transmission_loss"]
    assert later[0] is first[0] and all(one is same for one, same in zip(later, again, strict=True))
    assert np.max(np.abs(later[1][1] - first[1][1])) > 0.1 * np.max(np.abs(first[1][1]))
    columns.forget_all_but(held)
    assert columns.rows(held, candidates)[1] is later[1] and len(made) == 3
    columns.forget_all_but(scene)
    assert columns.rows(held, candidates)[0] is first[0]
    assert made[3:] == ["transmission_loss"]


def test_slopes_are_those_of_the_rows_and_of_the_joints_alone_that_it_acts_on(gapped: Observations):
    scene = scene_on(gapped.model, wls(gapped).value, gapped)
    columns, share, step = CandidateColumns(gapped), 0.2, 1e-4
    candidate = Candidate(TransmissionLoss(), Member(1, (share,)))
    slopes = columns.slopes(scene, candidate)
    own = slopes[1]
    assert list(slopes) == [1]
    assert own.shape == (len(gapped.model.rigid_body.columns) + 2, gapped.joints[1].table.shape[1])
    up, down = columns.rows(scene, [candidate.at([share + side * step]) for side in (1.0, -1.0)])
    by_share = share * (up[1] - down[1])[0] / (2.0 * step)
    # A difference errs by the square of its step.
    assert_allclose(own[-1], by_share, rtol=0.0, atol=step**2 * np.max(np.abs(by_share)))


def test_without_candidates_the_rows_are_those_of_the_model():
    seen = observed(exact_runs()[:1])
    for one, other in zip(with_columns(seen, []), seen.joints, strict=True):
        assert_array_equal(one.table, other.table)
    assert CandidateColumns(seen).rows(scene_on(seen.model, wls(seen).value, seen), []) == []


@pytest.mark.slow
def test_columns_made_in_two_processes_are_the_same_to_the_last_bit(
    gapped: Observations, monkeypatch: pytest.MonkeyPatch
):
    scene = scene_on(gapped.model, wls(gapped).value, gapped)
    many = [Candidate(effect, member) for effect in CATALOGUE for member in effect.members(scene)]
    assert len(many) >= WORTH_A_PROCESS
    found = {}
    for cores in (1, 2):
        monkeypatch.setattr(processes, "available_cores", lambda cores=cores: cores)
        found[cores] = CandidateColumns(gapped).rows(scene, many)
    for one, other in zip(found[1], found[2], strict=True):
        assert one.keys() == other.keys()
        for joint in one:
            assert_array_equal(one[joint], other[joint])


def test_what_is_forgotten_to_save_memory_is_made_again_alike():
    observations = observed(exact_runs()[:2])
    columns = CandidateColumns(observations)
    scene = scene_on(observations.model, wls(observations).value, observations)
    items = [Candidate(effect, member) for effect in (Spring(), BaseTilt()) for member in effect.members(scene)[:2]]
    before = columns.noisier.rows(scene, items)
    noisy = columns.noisier
    columns.lean()
    assert columns.noisier is not noisy
    for old, new in zip(before, columns.noisier.rows(scene, items), strict=True):
        assert old.keys() == new.keys()
        for joint, rows in old.items():
            assert_array_equal(rows, new[joint])


@pytest.mark.parametrize("lower", [(0.5, 0.5), (0.5, 1.0)])
def test_bands_that_are_left_take_what_only_they_needed_with_them(lower):
    observations = observed(exact_runs()[:2])
    columns = CandidateColumns(observations)
    bands = tuple(share * band for share, band in zip(lower, observations.data.bands, strict=True))
    below = set(columns.at(bands).observations.data.stretches[0].cuts)
    drawn = noisier(observations.data)
    part = observations.data.stretches[0]
    own = set(part.cuts)
    cuts = {cut for _, cut in part.stretch._filtered}
    columns.leave()
    left = {cut for _, cut in part.stretch._filtered}
    assert left < cuts and own <= left and not left & (below - own)
    assert noisier(observations.data) is not drawn


class Lost(Spring):
    """A spring of no number at one moment of one recording."""

    name = "lost"

    def signal_columns(self, signals, member):
        (turn, *others) = super().signal_columns(signals, member)
        return [
            np.where(signals.time == 2.0, np.log(0.0 * turn), turn) if signals.motion.name == "A_2" else turn,
            *others,
        ]


@pytest.mark.parametrize("count", [3, WORTH_A_PROCESS])
def test_columns_that_are_not_finite_are_zero_and_those_that_pass_the_filter_with_them_what_they_are(count: int):
    seen = observed(exact_runs())
    scene = scene_on(seen.model, wls(seen).value, seen)
    sound = [Candidate(Stribeck(), Member(0, (0.01 * k,))) for k in range(1, count)]
    lost = Candidate(Lost(), Member(0))
    alone, beside = CandidateColumns(seen), CandidateColumns(seen)
    (zero, *found), expected = beside.rows(scene, [lost, *sound]), alone.rows(scene, sound)
    assert_array_equal(zero[0], 0.0)
    for one, other in zip(found, expected, strict=True):
        # What passes the filter together may be rounded otherwise.
        assert_allclose(one[0], other[0], rtol=1e-9, atol=1e-15)
    assert all(not np.any(part[0]) for part in beside.raw(scene, [lost])[0])
    assert beside.not_finite_on(scene, lost) == ("A_2",)
    assert not any(beside.not_finite_on(scene, item) for item in sound)
    assert beside.beside(seen).not_finite_on(scene, lost) == ("A_2",)
