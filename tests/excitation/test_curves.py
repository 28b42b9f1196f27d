import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import UsageError
from scara_ident.excitation import curves
from scara_ident.excitation.curves import ExcitationTrajectory, make_basis


def trajectory(family: str, seed: int, *, fixed_start: bool = False, duration: float = 7.0) -> ExcitationTrajectory:
    basis = make_basis(duration, 8, family, fixed_start=fixed_start)
    rng = np.random.default_rng(seed)
    return ExcitationTrajectory("x", ("j1", "j2"), basis, np.array([0.3, -1.0]), rng.standard_normal((2, basis.size)))


@given(family=st.sampled_from(["fourier", "spline"]), seed=st.integers(0, 2**31), duration=st.floats(0.5, 60.0))
@settings(max_examples=30)
def test_every_motion_starts_and_ends_at_rest(family, seed, duration):
    made = trajectory(family, seed, duration=duration)
    _, v, a = made.at(np.array([0.0, duration]))
    _, speeds, pushes = made.at(np.linspace(0.0, duration, 200))
    assert np.max(np.abs(v)) < 1e-12 * np.max(np.abs(speeds))
    assert np.max(np.abs(a)) < 1e-11 * np.max(np.abs(pushes))


@pytest.mark.parametrize("family", ["fourier", "spline"])
def test_velocity_and_acceleration_are_derivatives_of_position(family):
    made = trajectory(family, 1)
    time, h = np.linspace(0.1, 6.9, 50), 1e-4
    for order in range(2):
        before, after = made.at(time - h)[order], made.at(time + h)[order]
        np.testing.assert_allclose((after - before) / (2 * h), made.at(time)[order + 1], rtol=0, atol=1e-4)


def test_a_fixed_start_is_kept_and_harmonics_come_back_to_it():
    made = trajectory("fourier", 2, fixed_start=True)
    q = made.at(np.array([0.0, 7.0]))[0]
    np.testing.assert_allclose(q, np.column_stack([made.posture, made.posture]), atol=1e-12)


def test_the_series_in_plain_terms_gives_the_motion_back():
    made = trajectory("fourier", 3)
    time = np.linspace(0.0, 7.0, 40)
    for joint, series in enumerate(made.series()):
        phase = np.outer(2 * np.pi * np.arange(1, 9) / 7.0, time)
        q = series["offset"][0] + series["cosine"] @ np.cos(phase) + series["sine"] @ np.sin(phase)
        np.testing.assert_allclose(q, made.at(time)[0][joint], atol=1e-12)


def test_long_motions_are_evaluated_piece_by_piece_alike(monkeypatch):
    made = trajectory("fourier", 5)
    time = np.linspace(0.0, 7.0, 101)
    whole = made.at(time)
    monkeypatch.setattr(curves, "CHUNK", 13)
    for once, by_pieces in zip(whole, made.at(time), strict=True):
        np.testing.assert_allclose(by_pieces, once, atol=1e-13)


def test_the_paper_counts_both_ends_among_its_samples():
    motion = trajectory("fourier", 4).motion(2500)
    assert motion.samples == 2500
    assert motion.time[0] == 0.0 and motion.time[-1] == 7.0


@pytest.mark.parametrize(("duration", "harmonics"), [(5.0, 2), (5.0, [0, 1, 2]), (0.0, 5), (np.inf, 5)])
def test_too_little_to_move_by_is_said(duration, harmonics):
    with pytest.raises(UsageError, match="expected"):
        make_basis(duration, harmonics)


def test_a_family_that_is_none_is_said():
    with pytest.raises(UsageError, match="family 'wavelet': expected one of fourier, spline"):
        make_basis(5.0, 5, "wavelet")
