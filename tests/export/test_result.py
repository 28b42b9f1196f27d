"""Models read back from result files: of an identification and of a diagnosis with effects."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member, available_effects
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.effects.signals import ModelledEffect
from scara_ident.errors import ScaraIdentError
from scara_ident.estimation import Estimate
from scara_ident.export.identified_model import IdentifiedModel, identified_model
from scara_ident.export.result import KEY, _robot_entry, read_identified, rebuild_entry
from scara_ident.files import json_text, write_json
from scara_ident.identification.identify import Identification
from scara_ident.report.identification import identification_dict
from scara_ident.robot.robot import load_robot
from tests.export.identified import model_torque, states, with_effects
from tests.report.simulated import made, run


@pytest.fixture(scope="module")
def found() -> Identification:
    return made([run("OJD_1", 1), run("OJD_2", 2)], [run("CI_1", 3, start=4.0)], method="consistent")


@pytest.fixture(scope="module")
def content(found: Identification) -> dict:
    return json.loads(json_text(identification_dict(found)))


@pytest.fixture
def read(tmp_path: Path):
    def write(content: dict, robot: Path | None = None) -> IdentifiedModel:
        write_json(tmp_path / "r.json", content)
        return read_identified(tmp_path / "r.json", robot)

    return write


def test_an_identification_reads_back_with_its_errors(found, content, read):
    back = read(content)
    assert back.model.names == found.model.names
    np.testing.assert_array_equal(back.value, found.estimate.value)
    np.testing.assert_array_equal(back.weights, found.estimate.weights)
    np.testing.assert_array_equal(back.standard, found.estimate.standard)
    np.testing.assert_allclose(back.information.rms(), found.estimate.information.rms(), rtol=1e-9)
    own = identified_model(found)
    assert (back.bands, back.found, back.undetermined.tolist()) == (own.bands, (), own.undetermined.tolist())
    for name in ("value", "std", "covariance", "before", "rms", "standard"):
        np.testing.assert_allclose(getattr(back, name), getattr(own, name), rtol=1e-9)
    for name in ("lower", "upper", "speed", "acceleration"):
        np.testing.assert_array_equal(getattr(back.reached, name), getattr(own.reached, name))
    earlier = {key: value for key, value in content.items() if key != "range"}
    assert read(earlier).reached is None
    assert back.errors(back.value) == pytest.approx(own.errors(own.value), rel=1e-9)
    assert back.held_out[0] == "validation"
    for joint, error in back.errors(back.value).items():
        assert error == pytest.approx(content["errors"]["validation"]["CI_1"][joint]["rms"], rel=1e-9)
    motion = states(found.model.robot, 0, 5)
    predicted = found.estimate.predict(motion.q.T, motion.v.T, motion.a.T).T
    np.testing.assert_allclose(model_torque(back, back.value, motion), predicted, rtol=1e-12, atol=1e-12)


def test_a_parameter_without_a_value_is_named_where_all_are_needed(content, read, tmp_path: Path):
    open_ = json.loads(json.dumps(content))
    open_["parameters"][1] |= {"value": None, "std": None, "undetermined": True}
    assert read(open_).undetermined.tolist() == [k == 1 for k in range(15)]
    with pytest.raises(ScaraIdentError, match=r"r\.json: parameter 'P_d2' has no value; record"):
        read_identified(tmp_path / "r.json", determined=True)
    with pytest.raises(ScaraIdentError, match="model 'mine' is not known here"):
        read(open_ | {"model": "mine"})


def test_a_joint_at_rest_has_no_error_and_the_others_have_theirs(content, read):
    still = json.loads(json.dumps(content))
    for kind in ("training", "validation"):
        for own in still["errors"][kind].values():
            own["joint2"] = dict.fromkeys(own["joint2"])
    rms = read(still).rms
    assert rms[0] == pytest.approx(content["errors"]["validation"]["CI_1"]["joint1"]["rms_unfiltered"], rel=1e-9)
    assert np.isnan(rms[1])


def test_every_effect_reads_back_as_it_was(found, content, read):
    base = found.model
    names = tuple(sorted({effect.name for effect in available_effects() if effect.name != "time_delay"}))
    model = with_effects(base, found.estimate.value, names)
    k = len(model.columns)
    rng = np.random.default_rng(0)
    value = np.concatenate([found.estimate.value, rng.normal(size=k - len(base.columns))])
    estimate = Estimate(
        model, "wls", value, np.eye(k), np.zeros(k, dtype=bool), found.estimate.information, found.estimate.weights, ""
    )
    parameters = [column.entry(value=x, std=1.0) for column, x in zip(model.columns, value, strict=True)]
    entry = rebuild_entry(estimate, found.training, replace(found.validation))
    # The observations are those of the base model; only terms are looked at.
    entry["observations"] = {"training": [], "validation": []}
    wider = content | {"parameters": parameters, KEY: entry, "effects": [{"effect": "time_delay"}]}
    nothing = [{"samples": 0.0, "rows": 0, "factor": ""}] * 2
    wider[KEY]["observations"] = {"training": nothing, "validation": nothing}
    back = read(wider)
    assert back.removed == ("time_delay",)
    assert back.held_out[0] == "training" and back.errors(value) == {"joint1": None, "joint2": None}
    assert len(back.model.terms) > 15
    for one, other in zip(back.model.terms[3:], model.terms[3:], strict=True):
        assert (one.effect, one.member) == (other.effect, other.member)
    motion = states(model.robot, 0, 5)
    state = [term for term in model.terms[3:] if not term.effect.of_state]
    for term in state:
        value[model.place(term)] = 0.0
    expected = np.einsum("jpn,p->jn", model.regressor(motion), value)
    np.testing.assert_array_equal(model_torque(back, value, motion), expected)


def test_what_acts_on_links_reads_back_with_the_load_of_a_gear(found, content, read):
    base = found.model
    model = with_effects(base, found.estimate.value, ("spring", "transmission_loss"))
    payload, group = PayloadOfRecordings(frozenset(["empty"])), Member(None, partner=1)
    count = len(payload.columns(model.terms[-1].scene, group))
    body = ModelledEffect(payload, group, tuple(np.linspace(0.5, 1.5, count).tolist()))
    terms = [replace(term, scene=replace(term.scene, link_torques=(body,))) for term in model.terms[len(base.terms) :]]
    model = replace(model, terms=(*base.terms, *terms))
    k = len(model.columns)
    value = np.concatenate([found.estimate.value, np.full(k - len(base.columns), 0.1)])
    estimate = Estimate(
        model, "wls", value, np.eye(k), np.zeros(k, dtype=bool), found.estimate.information, found.estimate.weights, ""
    )
    parameters = [column.entry(value=x, std=1.0) for column, x in zip(model.columns, value, strict=True)]
    entry = rebuild_entry(estimate, found.training, found.validation)
    nothing = [{"samples": 0.0, "rows": 0, "factor": ""}] * 2
    entry["observations"] = {"training": nothing, "validation": nothing}
    wider = content | {"parameters": parameters, KEY: entry, "effects": []}
    back = read(wider)
    assert [term.scene.link_torques for term in back.model.terms[len(base.terms) :]] == [(body,)] * len(terms)
    motion = states(model.robot, 0, 5)
    np.testing.assert_array_equal(back.model.regressor(motion), model.regressor(motion))
    del wider[KEY]["scene"]["on_links"]
    assert read(wider).model.terms[-1].scene.link_torques == ()


def test_effects_that_act_together_read_back_with_each_other(found, content, read):
    base = found.model
    model = with_effects(base, found.estimate.value, ("joint_elasticity",))
    terms = model.terms[len(base.terms) :]
    together = tuple((term.effect, replace(term.member, joint=j)) for j, term in enumerate(terms * 2) if j < 2)
    model = replace(
        model, terms=(*base.terms, *(replace(term, scene=replace(term.scene, together=together)) for term in terms))
    )
    k = len(model.columns)
    value = np.concatenate([found.estimate.value, np.full(k - len(base.columns), 1e-5)])
    estimate = Estimate(
        model, "wls", value, np.eye(k), np.zeros(k, dtype=bool), found.estimate.information, found.estimate.weights, ""
    )
    entry = rebuild_entry(estimate, found.training, found.validation)
    nothing = [{"samples": 0.0, "rows": 0, "factor": ""}] * 2
    entry["observations"] = {"training": nothing, "validation": nothing}
    parameters = [column.entry(value=x, std=1.0) for column, x in zip(model.columns, value, strict=True)]
    wider = content | {"parameters": parameters, KEY: entry, "effects": []}
    assert read(wider).model.terms[-1].scene.together == together
    # Results of earlier versions have none.
    del wider[KEY]["scene"]["together"]
    assert read(wider).model.terms[-1].scene.together == ()


def test_a_diagnosis_without_recordings_held_out_has_the_errors_of_the_training(content, read):
    told = {"after_unfiltered": {"joint1": 0.5, "joint2": 0.25}}
    diagnosis = {**content, "errors": None, "training": told, "validation": {"before": {}, "after": {}}}
    assert read(diagnosis).rms.tolist() == [0.5, 0.25]
    assert read(diagnosis | {"validation": {"after_unfiltered": {"joint1": 1.0, "joint2": 2.0}}}).rms.tolist() == [
        1.0,
        2.0,
    ]
    with pytest.raises(
        ScaraIdentError, match=r"r\.json: damaged, or of another version \(KeyError: 'std'\); make it again"
    ):
        read(
            {
                **content,
                "parameters": [{key: x for key, x in item.items() if key != "std"} for item in content["parameters"]],
            }
        )


def test_limits_of_the_description_come_with_the_robot(found, content, read, tmp_path: Path):
    robot = replace(
        found.model.robot, acceleration_limit=np.array([15.0, np.inf]), jerk_limit=np.array([np.inf, 500.0])
    )
    back = read(content | {KEY: content[KEY] | {"robot": _robot_entry(robot)}}).robot
    assert (back.acceleration_limit.tolist(), back.jerk_limit.tolist()) == ([15.0, np.inf], [np.inf, 500.0])


def test_the_mapping_of_the_recordings_comes_with_the_robot(found, content, read, tmp_path: Path):
    (tmp_path / "robot.yaml").write_text(
        f"urdf: {found.model.robot.urdf}\neffort_side: motor\njoints: {{joint1: {{}}, joint2: {{}}}}\n"
        "recording: {time: {column: t, unit: ms}, position: {column: 'q{number}', unit: deg}}\n"
    )
    robot = load_robot(tmp_path / "robot.yaml")
    entry = json.loads(json_text(_robot_entry(robot)))
    assert read(content | {KEY: content[KEY] | {"robot": entry}}).robot.channels == robot.channels
    assert read(content).robot.channels is None


def test_a_robot_that_has_moved_can_be_given(content, read, tmp_path: Path):
    robot = content[KEY]["robot"]
    copy = tmp_path / "scara03.urdf"
    copy.write_bytes(Path(robot["urdf"]).read_bytes())
    gone = json.loads(json.dumps(content))
    gone[KEY]["robot"]["urdf"] = str(tmp_path / "gone.urdf")
    with pytest.raises(ScaraIdentError, match=r"gone\.urdf, is not there; give robot$"):
        read(gone)
    description = tmp_path / "robot.yaml"
    description.write_text("urdf: scara03.urdf\neffort_side: motor\njoints: {joint1: {}, joint2: {}}\n")
    np.testing.assert_array_equal(read(gone, description).value, read(content).value)
    gone[KEY]["robot"]["urdf"] = str(copy)
    read(gone)
    copy.write_text(copy.read_text() + "<!-- -->")
    with pytest.raises(ScaraIdentError, match="has changed since"):
        read(gone)
    with pytest.raises(ScaraIdentError, match="its parameters are not those of"):
        read(content, Path("ur5"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "no such file"),
        ("{", "not JSON"),
        ("{}", "holds no model"),
        ('{"model": "complete"}', "holds no model"),
    ],
)
def test_what_is_no_result_is_said_in_a_line(tmp_path: Path, text: str | None, said: str):
    path = tmp_path / "r.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ScaraIdentError, match=said):
        read_identified(path)


def test_an_effect_that_is_not_installed_is_named(content, read):
    wider = json.loads(json.dumps(content))
    scene = {"value": [], "duration": 1.0, "rate": 1.0, "band": 1.0, "travel": [], "speed": [], "start": {}}
    wider[KEY]["scene"] = scene | {"armatures": {}}
    wider[KEY]["effects"] = [
        {"effect": "spring", "family": "Coil", "options": {}, "joint": 0, "nonlinear": [], "partner": None}
    ]
    with pytest.raises(ScaraIdentError, match="spring cannot be made again: no kind Coil"):
        read(wider)
