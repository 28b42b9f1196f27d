"""When more recordings no longer pay: expected std against the inverse of the normal matrix."""

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.estimation.information import merge
from scara_ident.excitation import information_of
from scara_ident.excitation.stopping import asked_std, noise_of, stopping
from tests.excitation.designs import COMPLETE, SCARA

VALUES = {"P_d1": 10.0, "P_d2": -0.5, "a01": 0.0}


def std_of(*parts):
    return np.sqrt(np.diag(np.linalg.inv(sum(each.regressor_factor.T @ each.regressor_factor for each in parts))))


@pytest.fixture(scope="module")
def pair(short):
    """The short design taken for two motions, one after the other."""
    one = short.trajectories[0]
    each = information_of(COMPLETE, one, 400, short.weights)
    return replace(short, trajectories=(one, one), samples=(400, 400), information=merge([each, each])), each


@pytest.mark.slow
def test_the_first_motion_that_suffices_is_named(pair):
    design, each = pair
    once, twice = (std_of(*count * [each])[0] for count in (1, 2))
    for asked, suffices, repetitions in ((1.1 * once, 1, 1), (1.1 * twice, 2, 1), (0.3 * twice, None, 12)):
        found = stopping(design, {"P_d1": asked})
        assert [(item.motions, item.seconds) for item in found.after] == [(1, 4.0), (2, 8.0)]
        assert [item.std for item in found.after] == pytest.approx([once, twice], rel=1e-9)
        assert (found.suffices, found.repetitions) == (suffices, repetitions)
        assert found.entry()["after"][0]["share"] == pytest.approx(once / asked)
    assert "takes 12 recordings of each motion" in found.words()
    assert stopping(design, {"P_d1": 1e-4 * twice}).repetitions is None


@pytest.mark.slow
def test_recordings_at_hand_count_and_the_worst_parameter_is_reported(pair):
    design, each = pair
    known = replace(design, prior=each.scaled(3.0))
    std = std_of(each) / 3.0
    found = stopping(known, {"P_d1": 1.1 * std[0], "P_d2": 1.2 * std[1]}, ("a01",))
    assert (found.suffices, found.repetitions) == (0, 0)
    assert (found.after[0].motions, found.after[0].parameter) == (0, "P_d1")
    assert stopping(known, {"P_d1": 0.95 * std[0]}).repetitions == 1
    assert "no more are needed. Not judged, because no value is known to take a percentage of: a01." in found.words()


def test_what_is_asked_is_read():
    assert asked_std(["5%"], VALUES) == ({"P_d1": 0.5, "P_d2": 0.025}, ("a01",))
    assert asked_std(["10", "a01=0.02"], VALUES) == ({"a01": 0.02, "P_d1": 1.0, "P_d2": 0.05}, ())
    assert asked_std(["a01=0.02"], VALUES) == ({"a01": 0.02}, ())
    for words, said in (
        (["0"], "expected a percentage"), (["a01=5%"], "expected a percentage"), (["b=1"], "'b' is not among"),
        (["5", "6"], "two percentages"),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=said):
            asked_std(words, VALUES)
    with pytest.raises(UsageError, match="no value is known"):
        asked_std(["5"], {"a01": 0.0})


def test_noise_is_given_or_the_residual_of_an_identification(tmp_path):
    path = tmp_path / "identification.json"
    runs = {"A_1": {"joint1": {"rms": 0.02}, "joint2": {"rms": 0.01}}, "A_2": {"joint1": {"rms": 0.03}}}
    path.write_text(json.dumps({"errors": {"training": runs}, "band_hz": {"joint1": 12.5, "joint2": None}}))
    # White up to 12.5 Hz is twice as large up to 50 Hz.
    np.testing.assert_allclose(noise_of(SCARA, {}, path), [0.06, 0.01])
    np.testing.assert_allclose(noise_of(SCARA, {"joint1": 0.5}, path), [0.5, 0.01])
    for given, said in (
        ({"joint1": 1.0}, "noise of joint2 is not known"),
        ({"joint1": -1.0}, "above 0"),
        ({"j": 1.0}, "'j'"),
    ):
        with pytest.raises(UsageError, match=said):
            noise_of(SCARA, given, None)
    path.write_text("{}")
    with pytest.raises(ScaraIdentError, match="no training errors"):
        noise_of(SCARA, {}, path)
