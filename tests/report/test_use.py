"""What ``use.json`` says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.held_out.gain import HeldOutGain
from scara_ident.report.use import _cost_said, sentences, total, use_dict
from scara_ident.simulation import parse_effect, virtual_arm
from scara_ident.use import Use
from scara_ident.use.tracking import Tracked
from scara_ident.use.trial_motion import trial_motion
from scara_ident.use.worth import EffectWorth
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
        "The tracking error, relative to the PID alone, is 50% with the URDF fed forward, 25% with the identified "
        "model and 10% with the effects found."
    )
    assert "the position error after 0.2 s is joint1 0.01 rad, joint2 0.02 rad" in others[1]
    lost = replace(result(), rollouts={"identified": np.full((2, 2), np.inf)})
    assert "diverges" in sentences(lost)[1]
    nowhere = sentences(replace(result(), rollouts={"identified": np.full((2, 2), np.nan)}))[1]
    assert (
        "has no moment at which all joints move and 0.5 s follow; give a recording in which all joints move at the same time"
        in nowhere
    )
    # What is not simulated is not among the effects that were.
    assert others[1].startswith("Simulated with the effects found but drive_coupling, the position error")
    assert others[-1] == "Not simulated: drive_coupling."
    assert "with the effects found, the position error" in " ".join(sentences(replace(result(), missing=())))
    assert not any("harm" in words for words in others)
    assert total(np.array([3.0, 0.0]), np.array([3.0, 1.0])) == pytest.approx(np.sqrt(0.5))


def test_where_an_effect_fed_forward_makes_worse_it_is_said_of_the_joint() -> None:
    made = result()
    (run,) = made.runs
    # As a ripple did that the controller was too slow for.
    worse = tuple(replace(item, error=item.error * ([[1.0], [6.0]] if item.name == "effects" else 1.0)) for item in run)
    said = sentences(replace(made, runs=(worse,)))[1]
    assert said == (
        "In the feed-forward the effects do harm on joint2 (60% of the PID's error, without them 25%): leave them out there."
    )
    # 1.5 and 1.9 % are 2 % both: as a share of what is left a fourth more, and of the PID's error nothing.
    little = {"identified": 0.06, "effects": 0.076}
    near = tuple(replace(item, error=item.error / np.abs(item.error) * little.get(item.name, 4.0)) for item in run)
    assert not any("harm" in words for words in sentences(replace(made, runs=(near,))))
    small = EffectWorth({"effect": "spring", "joint": "joint1"}, np.full(2, 2.0), np.full(2, 0.06))
    assert _cost_said(small, {"pid": np.full(2, 4.0), "effects": np.full(2, 0.076)}).endswith(
        "spring of joint1: if the arm did not have it, the error of the PID alone would be 50% of its present value."
    )
    found = EffectWorth({"effect": "spring", "joint": "joint1"}, np.full(2, 2.0), np.full(2, 1.0))
    rms = {"pid": np.full(2, 4.0), "effects": np.full(2, 2.0)}
    assert _cost_said(found, rms).endswith(
        "; with all effects in the feed-forward the error is 50% of that value, with all but this one 25%: it does harm, so leave it out of the feed-forward."
    )
    assert _cost_said(replace(found, not_fed=np.full(2, 1.9)), rms).endswith("all but this one 48%.")


def test_an_effect_in_doubt_is_said_to_be_fed_forward_all_the_same() -> None:
    made = result()
    assert not any("in doubt" in words for words in sentences(made))
    (spring,) = made.model.found
    gain = HeldOutGain(-0.3, 0.1, 0.05, "joint1", 0.02, 0.03)
    doubted = replace(made.model, found=({**spring, "held_out": gain.entry()},))
    said = "Spring of joint1 is in doubt: 10 ± 5 % of it shows on the held-out recordings; it is in the feed-forward."
    assert said in sentences(replace(made, model=doubted))


def test_what_no_virtual_arm_can_have_is_said_in_words_and_in_the_json() -> None:
    told = replace(result(), notes=("joint2 has no rotor.",))
    assert sentences(told)[-1] == "joint2 has no rotor."
    assert use_dict(told)["notes"] == ["joint2 has no rotor."]
