"""Every form on three arms, with and without effects, read by the program that it is for."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from scara_ident.diagnosis.held_out.gain import HeldOutGain
from scara_ident.errors import ScaraIdentError
from scara_ident.export import exported
from scara_ident.export.exported import export_model, write_exported
from scara_ident.export.forms import FORMS
from scara_ident.motion.recorded_range import RecordedRange
from tests.export.identified import NOISE, model_torque, states

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("effects", [False, True], ids=["plain", "effects"])
@pytest.mark.parametrize("arm", ["scara", "ur5", "panda"])
@pytest.mark.parametrize("to", FORMS)
def test_every_form_gives_the_model_s_torque_in_what_it_can_say(models, readers, tmp_path, arm, effects, to):
    found = models[arm, effects]
    motion = states(found.robot, 7, 6)
    done = export_model(found, to)
    content = write_exported(found, done, tmp_path, "identification.json")
    assert {path.name for path in tmp_path.iterdir()} == {*done.files, "export.json"}
    for key, said in (("exported", done.alone), ("with_code", done.beside)):
        if said is None:
            continue
        read = readers.READERS[to] if key == "exported" else partial(readers.READERS[to], effects=True)
        torque = read(tmp_path, found.robot, motion.q, motion.v, motion.a)
        expected = model_torque(found, said.value, motion)
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))
        errors, model = content["errors"][key], content["errors"]["model"]
        assert content["errors_of"] == "validation"
        complete = key == "with_code" or to in ("c", "casadi") or (to == "ros2" and not effects)
        assert bool(said.missing) == (not complete)
        for joint in found.robot.joints:
            assert model[joint] == pytest.approx(NOISE, rel=0.2)
            assert errors[joint] == pytest.approx(model[joint], rel=1e-6) or not complete
        assert (max(errors.values()) > 1.5 * max(model.values())) == (not complete)


@pytest.mark.parametrize("to", FORMS)
def test_what_the_recordings_leave_open_is_said_beside_and_in_the_file(models, to):
    found = models["scara", False]
    open_ = np.array([name == "a02" for name in found.model.names])
    done = export_model(replace(found, undetermined=open_), to)
    said = "recordings do not determine a02: torques that depend on them are not known"
    assert f"the {said}" in done.notes
    code = [text for name, text in done.files.items() if name.endswith((".h", ".py", ".yaml"))]
    assert all(f"The {said}." in text for text in code)


@pytest.mark.parametrize("to", ["c", "casadi"])
def test_how_fast_the_recordings_were_is_said_in_the_file(models, to):
    reached = RecordedRange(np.zeros(2), np.zeros(2), np.array([1.25, 0.5]), np.zeros(2))
    known = replace(models["scara", False], reached=reached)
    for model, count in ((known, 1), (replace(known, reached=None), 0)):
        (text,) = export_model(model, to).files.values()
        assert text.count("friction is extrapolated: joint1 1.25 rad/s, joint2 0.5 rad/s.") == count


@pytest.mark.parametrize("to", ["c", "mjcf"])
def test_an_effect_that_recordings_held_out_speak_against_is_said_beside_and_in_the_file(models, to):
    gain = HeldOutGain(-0.3, 0.1, 0.05, "joint1", 0.02, 0.03)
    entries = tuple(
        {"effect": name, "joint": joint, "parameters": {}, "held_out": told}
        for name, joint, told in (
            ("spring", "joint1", gain.entry()),
            ("base_tilt", None, replace(gain, size=1.0).entry()),
            ("stribeck", "joint2", None),
        )
    )
    done = export_model(replace(models["scara", False], found=entries), to)
    said = "spring of joint1 is in doubt: 10 ± 5 % of it shows on the held-out recordings"
    assert [note for note in done.notes if "in doubt" in note] == [said]
    code = [text for name, text in done.files.items() if name.endswith((".h", ".py"))]
    assert code
    assert all(f"{said[0].upper()}{said[1:]}." in text for text in code)


def test_nothing_is_written_where_a_file_fails(models, tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise ScaraIdentError("cannot be written")

    done = export_model(models["scara", False], "mjcf")
    monkeypatch.setattr(exported, "write_json", refuse)
    with pytest.raises(ScaraIdentError, match="cannot be written"):
        write_exported(models["scara", False], done, tmp_path / "out", "x.json")
    assert not (tmp_path / "out").exists()
