"""The automatic band against where the noise of a known position is."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from scara_ident.estimation.bands import (
    HIGHEST_BAND,
    ROWS_PER_PARAMETER,
    _widened,
    choose_bands,
    narrowest_bands,
    needed_rows,
)
from scara_ident.estimation.explained_power import Explained, Spectra, binned_power
from scara_ident.estimation.observations import kept_rows
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, recorded_torque, recording, write_urdf

RATE = 500.0
FRICTION = ((0.4, 0.3, 0.0, 0.0, 0.1), (0.2, 0.1, 0.0, 0.0, -0.05))
SECONDS = 20.0


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    path = write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)
    return build_model(load_robot(path), "basic")


@pytest.fixture(scope="module")
def clean(model: TorqueModel) -> Recording:
    """Motion with a spectrum that falls slowly: many sines up to 20 Hz."""
    rng = np.random.default_rng(0)
    time = np.arange(round(SECONDS * RATE)) / RATE
    q, v, a = (np.zeros((2, len(time))) for _ in range(3))
    for j in range(2):
        for frequency in np.geomspace(0.2, 20.0, 40):
            w, size, phase = 2 * np.pi * frequency, 0.12 / (1 + (frequency / 0.8) ** 2), rng.uniform(0, 2 * np.pi)
            q[j] += size * np.sin(w * time + phase)
            v[j] += size * w * np.cos(w * time + phase)
            a[j] -= size * w**2 * np.sin(w * time + phase)
    return recording(model.robot, "mix_1", time, q, recorded_torque(model.robot, q, v, a, FRICTION))


def crossing(model: TorqueModel, clean: Recording, noise: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Frequency above which noise in the inertial torque exceeds half of the torque, joint by joint.

    An estimate of its own: the spectrum of the torque that the noise's acceleration makes, by the diagonal of the
    mean mass matrix.
    """
    import pinocchio as pin

    data = model.robot.model.createData()
    mass = np.mean([pin.crba(model.robot.model, data, q).copy() for q in clean.position.T[::50]], axis=0)
    mass = np.triu(mass) + np.triu(mass, 1).T
    frequency = np.fft.rfftfreq(noise.shape[1], 1 / RATE)
    shaken = np.fft.irfft(-((2 * np.pi * frequency) ** 2) * np.fft.rfft(noise, axis=1), noise.shape[1], axis=1)
    assert clean.effort is not None
    power = binned_power(mass @ shaken, RATE, edges)
    torque = binned_power(clean.effort, RATE, edges)
    over = power > 0.5 * (torque + power)
    return np.array([edges[int(np.argmax(row))] if row.any() else edges[-1] for row in over])


@pytest.mark.parametrize("sigma", [1e-5, 2e-4, 3e-3])
def test_the_band_ends_where_noise_overtakes_motion(model: TorqueModel, clean: Recording, sigma: float):
    rng = np.random.default_rng(1)
    noise = sigma * rng.standard_normal(clean.position.shape)
    found = choose_bands(model, prepare([replace(clean, position=clean.position + noise)]))
    expected = crossing(model, clean, noise, np.geomspace(0.5, 250.0, 30))
    ratio = np.array(found.bands) / expected
    assert np.all((ratio > 0.6) & (ratio < 1.7)), (found.bands, expected)
    assert min(found.explained) > 0.9
    assert found.notes == ()


def test_less_noise_gives_a_wider_band(model: TorqueModel, clean: Recording):
    bands = []
    for sigma in (1e-5, 3e-4, 3e-3):
        noise = sigma * np.random.default_rng(1).standard_normal(clean.position.shape)
        bands.append(choose_bands(model, prepare([replace(clean, position=clean.position + noise)])).bands)
    assert np.all(np.diff(bands, axis=0) < 0)


def test_a_bump_of_position_noise_at_8_to_15_hz_is_stayed_below(model: TorqueModel, clean: Recording):
    """Half a milliradian there, as measured on the double pendulum, where a wider band biases the result."""
    rng = np.random.default_rng(2)
    sections = butter(4, [8.0, 15.0], btype="bandpass", fs=RATE, output="sos")
    bump = sosfiltfilt(sections, rng.standard_normal(clean.position.shape), axis=1)
    bump *= 1.5e-3 / np.std(bump)
    found = choose_bands(model, prepare([replace(clean, position=clean.position + bump)]))
    assert max(found.bands) <= 10.0
    assert min(found.bands) >= 2.0


def test_without_noise_the_band_is_wide(model: TorqueModel, clean: Recording):
    assert min(choose_bands(model, prepare([clean])).bands) >= 20.0


def test_a_joint_that_stands_still_gets_a_band_and_leaves_the_other_alone(model: TorqueModel, clean: Recording):
    rng = np.random.default_rng(3)
    position = clean.position + 2e-5 * rng.standard_normal(clean.position.shape)
    position[1] = 0.4
    # Held by its friction: what the torque does there is no function of motion.
    torque = recorded_torque(
        model.robot,
        *(
            np.array([row, np.full_like(row, still)])
            for row, still in zip(derivatives(clean), (0.4, 0.0, 0.0), strict=True)
        ),
        FRICTION,
    )
    torque[1] += 0.05 * rng.standard_normal(torque.shape[1])
    found = choose_bands(model, prepare([replace(clean, position=position, effort=torque)]))
    assert all(0.4 < band <= 0.2 * RATE for band in found.bands)
    assert found.explained[0] > 0.9


def derivatives(item: Recording) -> list[np.ndarray]:
    """Of the first joint, on the periodic continuation: good enough away from the ends."""
    q = item.position[0]
    first = np.gradient(q, 1 / RATE)
    return [q, first, np.gradient(first, 1 / RATE)]


def test_torque_that_has_nothing_to_do_with_motion_is_said(model: TorqueModel, clean: Recording):
    rng = np.random.default_rng(4)
    assert clean.effort is not None
    torque = np.array([clean.effort[0], 5.0 * rng.standard_normal(clean.effort.shape[1])])
    found = choose_bands(model, prepare([replace(clean, effort=torque)]))
    (note,) = found.notes
    assert note.startswith("j2: at every frequency its motion explains less than half of its torque")
    assert found.explained[1] == 0.0


def test_joints_that_need_a_longer_recording_are_named_in_one_line(model: TorqueModel, clean: Recording):
    """Seven lines said it of a Panda."""
    # The torque's noise is above the motion's from a few hertz on.
    noise = np.array([[30.0], [6.0]]) * np.random.default_rng(4).standard_normal((2, 2000))
    assert clean.effort is not None
    short = replace(
        clean, time=clean.time[:2000], position=clean.position[:, :2000], effort=clean.effort[:, :2000] + noise
    )
    found = choose_bands(model, prepare([short]))
    (note,) = (note for note in found.notes if "record longer" in note)
    assert re.match(
        r"j1, j2: their motion explains their torque up to [\d.]+, [\d.]+ Hz, but bands below [\d.]+, ", note
    )
    assert note.endswith("Hz would leave fewer than 5 independent rows per parameter; record longer")


def test_the_order_of_recordings_does_not_matter(model: TorqueModel, clean: Recording):
    noise = 1e-4 * np.random.default_rng(5).standard_normal(clean.position.shape)
    assert clean.effort is not None
    whole = replace(clean, position=clean.position + noise)
    halves = [
        replace(
            whole,
            name=f"h{k}_1",
            trajectory=f"h{k}",
            time=whole.time[part],
            position=whole.position[:, part],
            effort=whole.effort[:, part],
        )
        for k, part in enumerate((slice(0, 5000), slice(5000, 10000)))
    ]
    forth, back = choose_bands(model, prepare(halves)), choose_bands(model, prepare(halves[::-1]))
    np.testing.assert_allclose(forth.bands, back.bands, rtol=1e-9)


def pendulum(model: TorqueModel, seconds: float, torque_noise: float, seed: int = 0, pace: float = 1.0) -> Recording:
    """A slow swing at 500 Hz with half a milliradian of noise, and torque that is mostly noise if so wanted."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = (np.zeros((2, len(time))) for _ in range(3))
    for j in range(2):
        for frequency in (0.3, 0.7, 1.1, 1.6):
            w, size, phase = 2 * np.pi * pace * frequency, 0.5 / (1 + frequency**2), rng.uniform(0, 2 * np.pi)
            q[j] += size * np.sin(w * time + phase)
            v[j] += size * w * np.cos(w * time + phase)
            a[j] -= size * w**2 * np.sin(w * time + phase)
    torque = recorded_torque(model.robot, q, v, a, FRICTION)
    scale = torque_noise * np.std(torque, axis=1, keepdims=True)
    noisy = torque + scale * rng.standard_normal(torque.shape)
    return recording(model.robot, "swing_1", time, q + 5e-4 * rng.standard_normal(q.shape), noisy)


@pytest.mark.parametrize("torque_noise", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("seed", range(3))
def test_noisy_torque_does_not_swing_the_band(model: TorqueModel, torque_noise: float, seed: int):
    """White noise as large as the torque has most of its power above what moves; the band stays where the motion is."""
    found = choose_bands(model, prepare([pendulum(model, 12.0, torque_noise, seed)]))
    assert min(found.bands) > 1.0
    assert max(found.bands) < 12.0


def test_the_search_for_bands_ends_where_fits_contradict_each_other():
    """Fits in a wide band that explain a narrow one only, and the other way round."""

    class Contrary(Spectra):
        def __init__(self) -> None:
            self.fits = 0

        def fit(self, bands: np.ndarray) -> Explained:
            self.fits += 1
            return Explained(bands, bands, np.where(bands > 5.0, 1.0, 90.0), np.zeros((2, 1)))

    spectra = Contrary()
    bands, fit = _widened(spectra, np.full(2, 2.0), np.full(2, 0.5), 100.0, None)
    assert spectra.fits < 10
    assert np.all(bands <= 5.0)
    np.testing.assert_array_equal(fit.bands, bands)


@pytest.mark.parametrize("seconds", [2.0, 4.0, 8.0, 30.0])
def test_the_band_leaves_more_rows_than_parameters(model: TorqueModel, seconds: float):
    """Held to the highest band where the recording is too short even for that."""
    for noise in (0.01, 3.0):
        data = prepare([pendulum(model, seconds, noise)])
        bands = choose_bands(model, data).bands
        rows = kept_rows(data.at(bands).recordings[0])
        assert rows >= ROWS_PER_PARAMETER * len(model.columns) or max(bands) >= HIGHEST_BAND * RATE


def test_rows_are_needed_where_parameters_act(model: TorqueModel):
    need = needed_rows(model)
    assert np.sum(need) == pytest.approx(len(model.columns))
    # Hall: no fewer than the parameters that act on that joint alone.
    alone = np.sum(model.pattern & (np.sum(model.pattern, axis=0) == 1), axis=1)
    assert np.all(need >= alone)


def test_the_narrowest_band_follows_from_time_and_parameters(model: TorqueModel):
    narrow = narrowest_bands(model, 1, np.array([20.0, 20.0]))
    rows = 2.0 * narrow * 20.0 - 4.0
    assert np.all(rows >= ROWS_PER_PARAMETER * needed_rows(model) - 1e-9)
    # One that hardly moves is not forced far up into noise; none that moves, none is asked for.
    odd = narrowest_bands(model, 1, np.array([20.0, 0.1]))
    assert odd[1] <= 2.0 * odd[0] * 1.0001
    assert np.all(narrowest_bands(model, 1, np.zeros(2)) == 0.0)


def test_the_rate_of_the_samples_does_not_move_the_band(model: TorqueModel):
    """Noise of the same density, at 500 and at 250 samples a second."""
    whole = pendulum(model, 20.0, 0.5)
    assert whole.effort is not None
    count = len(whole.time) // 2
    half = replace(
        whole,
        time=whole.time[: 2 * count].reshape(-1, 2).mean(axis=1),
        position=whole.position[:, : 2 * count].reshape(2, -1, 2).mean(axis=2),
        effort=whole.effort[:, : 2 * count].reshape(2, -1, 2).mean(axis=2),
    )
    one, other = (choose_bands(model, prepare([item])).bands for item in (whole, half))
    # Bins are a third of an octave.
    assert np.all(np.abs(np.log2(np.array(one) / other)) < 0.7)


def moves(model: TorqueModel, rate: float, size: tuple[float, float], noise: float, rests: float) -> Recording:
    """From point to point in a second each, with rests between at which friction holds with any share of Coulomb's."""
    rng = np.random.default_rng(6)
    time = np.arange(round(SECONDS * rate)) / rate
    period, q, v, a = 1.0 + rests, *(np.zeros((2, len(time))) for _ in range(3))
    turn = np.minimum(np.mod(time, period), 1.0)
    # Neither friction's sign nor its viscous part tells what it is at rest.
    held = (np.mod(time, period) >= 1.0) * np.array([[0.4], [0.2]])
    for j in range(2):
        points = np.array(size)[j] * rng.uniform(-1.0, 1.0, int(SECONDS / period) + 2)
        place = (time / period).astype(int)
        begin, way = points[place], np.diff(points)[place]
        q[j] = begin + way * (10.0 * turn**3 - 15.0 * turn**4 + 6.0 * turn**5)
        v[j] = way * (30.0 * turn**2 - 60.0 * turn**3 + 30.0 * turn**4)
        a[j] = way * (60.0 * turn - 180.0 * turn**2 + 120.0 * turn**3)
        held[j] *= rng.uniform(-1.0, 1.0, len(points))[place]
    torque = recorded_torque(model.robot, q, v, a, FRICTION) + held
    torque += 0.005 * np.std(torque, axis=1, keepdims=True) * rng.standard_normal(torque.shape)
    return recording(model.robot, "moves_1", time, q + noise * rng.standard_normal(q.shape), torque)


def test_what_friction_holds_at_rest_does_not_narrow_the_band(model: TorqueModel):
    found = choose_bands(model, prepare([moves(model, 100.0, (0.8, 0.8), 1e-5, 1.0)]))
    assert min(found.bands) > 10.0
    assert min(found.explained) > 0.99


def test_a_calm_recording_does_not_narrow_the_band_of_a_lively_one(model: TorqueModel):
    """At 1 kHz only the first is looked at; at the low rate, where the choice begins, both were."""
    calm, lively = moves(model, 1000.0, (0.05, 0.05), 3e-4, 0.0), moves(model, 1000.0, (0.8, 0.8), 3e-4, 0.0)
    lively = replace(lively, name="others_1", trajectory="others")
    one, other = (choose_bands(model, prepare(items)).bands for items in ((calm, lively), (lively, calm)))
    np.testing.assert_allclose(one, other, rtol=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_even_motion_with_sharp_turns_has_the_band_of_its_turns(model: TorqueModel, seed: int):
    """Such a motion was left at 0.7 to 1.2 Hz, and said to explain nothing or up to 0.4 Hz: 2 Hz of its first fit take its turns away."""
    rng, count = np.random.default_rng(seed), round(8.0 * RATE)
    speed = np.empty((2, count))
    for row in speed:
        square = np.sign(
            np.sin(2.0 * np.pi * np.arange(count + 59) / RATE / rng.uniform(2.5, 5.0) + rng.uniform(0.0, 6.0))
        )
        row[:] = rng.uniform(0.4, 0.8) * np.convolve(square, np.hanning(62)[1:-1] / np.sum(np.hanning(62)), "valid")
    way = np.cumsum(speed[:, 1:] + speed[:, :-1], axis=1) / 2.0 / RATE
    q, a = np.hstack([np.zeros((2, 1)), way]), np.gradient(speed, 1.0 / RATE, axis=1)
    torque = recorded_torque(model.robot, q, speed, a, FRICTION)
    torque += 0.01 * np.std(torque, axis=1, keepdims=True) * rng.standard_normal(torque.shape)
    step = 2.0 * np.pi / 2**16
    run = recording(model.robot, "sweep_1", np.arange(count) / RATE, step * np.round(q / step), torque)
    choice = choose_bands(model, prepare([run]))
    assert min(choice.bands) > 5.0
    assert not choice.notes
