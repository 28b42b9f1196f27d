"""The automatic band against where the noise of a known position is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from scara_ident.estimation.bands import binned_power, choose_bands
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
    assert note.startswith("j2: its motion explains under half of its torque at every frequency")
    assert found.explained[1] == 0.0


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


def test_binned_power_is_the_mean_square_whatever_the_bins():
    rng = np.random.default_rng(0)
    count = 20_000
    signals = rng.standard_normal((2, count)) * np.array([[1.0], [3.0]])
    edges = np.array([0.0, 10.0, 60.0, 250.0])
    power = binned_power(signals, RATE, edges)
    # White noise: shares as wide as the bins.
    np.testing.assert_allclose(power[1] / power[0], 9.0, rtol=0.1)
    np.testing.assert_allclose(power[0] / power[0].sum(), np.diff(edges) / 250.0, rtol=0.1)
    tone = np.sin(2 * np.pi * 30.0 * np.arange(count) / RATE)[None]
    assert binned_power(tone, RATE, edges)[0, 1] > 0.999 * binned_power(tone, RATE, edges).sum()
    np.testing.assert_allclose(binned_power(tone + 7.0, RATE, edges), binned_power(tone, RATE, edges), atol=1e-6)
