"""What ``use.json`` says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.report.use import sentences, total, use_dict
from scara_ident.simulation import parse_effect, virtual_arm
from scara_ident.use import Use
from scara_ident.use.tracking import Tracked
from scara_ident.use.trial_motion import trial_motion
from tests.use.made import with_spring


def result() -> Use:
    """Errors of one drawn arm, made up."""
    arm = virtual_arm()
    time = np.arange(4.0)
    sizes = {"pid": 4.0, "urdf": 2.0, "identified": 1.0, "effects": 0.4}
    runs = tuple(Tracked(name, time, size * np.array([[1.0, -1.0, 1.0, -1.0]] * 2)) for name, size in sizes.items())
    rollouts = {
        "identified": np.array([[0.1, 0.2], [np.nan, np.nan]]),
        "effects": np.array([[0.01, 0.02], [np.nan, np.nan]]),
    }
    spring = parse_effect("spring:joint1:stiffness=0.4").resolve(arm)
    return Use(
        with_spring(), trial_motion(arm), (runs,), (0.2, 0.5), rollouts, "", (spring,), ("drive_coupling",), (), {}
    )


def test_the_json_holds_the_rms_of_every_feed_forward_and_only_rollouts_that_were_long_enough() -> None:
    told = json.loads(json.dumps(use_dict(result())))
    assert told["tracking"]["effects"] == {"joint1": pytest.approx(0.4), "joint2": pytest.approx(0.4)}
    assert told["rollout"]["effects"] == {"0.2": {"joint1": 0.01, "joint2": 0.02}}
    assert told["not_simulated"] == ["drive_coupling"]
    assert told["units"] == {"joint1": "rad", "joint2": "rad"}


def test_the_words_give_shares_of_the_pids_error() -> None:
    first, *others = sentences(result())
    assert first == (
        "Of the PID's tracking error with the URDF fed forward leaves 50%, with the identified model 25%, "
        "with the effects found 10%."
    )
    assert "off after 0.2 s by joint1 0.01 rad, joint2 0.02 rad" in others[1]
    lost = replace(result(), rollouts={"identified": np.full((2, 2), np.inf)})
    assert "gets lost" in sentences(lost)[1]
    assert others[-1] == "Not simulated: drive_coupling."
    assert total(np.array([3.0, 0.0]), np.array([3.0, 1.0])) == pytest.approx(np.sqrt(0.5))
