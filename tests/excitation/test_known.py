import json

import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.excitation.known import read_parameters
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

MODEL = build_model(load_robot(), "basic")


def written(path, rows):
    path.write_text(json.dumps({"parameters": rows}), encoding="utf-8")
    return path


def test_what_an_identification_determined_is_known(tmp_path):
    rows = [
        {"name": "P_d1", "value": 16.0},
        {"name": "P_d3", "value": None},
        {"name": "a01", "value": 0.2, "undetermined": False},
        {"name": "a11", "value": 0.1, "undetermined": True},
    ]
    found = read_parameters(written(tmp_path / "identification.json", rows), MODEL)
    assert found == {"P_d1": 16.0, "a01": 0.2}


def test_of_a_diagnosis_those_of_the_model_are_known(tmp_path):
    rows = [{"name": name, "value": float(k)} for k, name in enumerate((*MODEL.names, "loss_coefficient"))]
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"verdict": "explained", "parameters": rows}), encoding="utf-8")
    assert read_parameters(path, MODEL) == {name: float(k) for k, name in enumerate(MODEL.names)}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "no such file"),
        ("nothing", "no parameters in it"),
        ("{}", "no parameters in it"),
        ('{"parameters": 3}', "no parameters in it"),
        ('{"parameters": [{"name": "a31", "value": 1.0}]}', "'a31' is not of the model basic, which has P_d1"),
    ],
)
def test_a_file_that_tells_no_parameters_of_the_model_is_said(tmp_path, text, said):
    path = tmp_path / "identification.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(ScaraIdentError, match=f"identification.json: .*{said}"):
        read_parameters(path, MODEL)
