"""What questions the whole result stands before all that it questions, in the terminal, in Markdown and on the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.estimation.urdf_weight import scale_in_words, turned_bodies
from scara_ident.identification.identify import Identification, identify
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.diagnosis_markdown import diagnosis_markdown
from scara_ident.report.doubts import doubts, parted
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.report.html.identification import IdentificationContext, identification_report
from scara_ident.report.identification import headline_and_details, identification_dict
from tests.identification.test_gravity_check import DOWN, UP, made

BANDS = (8.0,) * 3
GRAVITY = "Gravity seems to point along [0, 0, -1] of the base"


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    """Of an arm that is said to hang, and stands."""
    robot, run = made(tmp_path_factory.mktemp("arm"), DOWN, UP)
    return identify(robot, [run], model="basic", bands=BANDS)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    robot, run = made(tmp_path_factory.mktemp("arm"), DOWN, UP)
    return diagnose(robot, [run], model="basic", bands=BANDS, catalogue=())


def in_order(text: str, *parts: str) -> bool:
    places = [text.find(part) for part in parts]
    return -1 not in places and places == sorted(places)


@pytest.mark.slow
def test_gravity_that_points_elsewhere_stands_before_the_parameters(hanging: Identification, tmp_path: Path):
    content = identification_dict(hanging)
    (doubt,) = content["doubts"]
    assert doubt.startswith(GRAVITY)
    assert content["summary"].count(doubt) == 1
    assert parted(content) == ([doubt], content["summary"][1:])
    # Printed before the notes, some of which every result has.
    noted = replace(hanging, notes=("what every result has",))
    assert in_order(noted.summary(), GRAVITY, "note: ", "meaning", "Recordings cannot determine a common scale")
    identification_report(tmp_path / "report.html", IdentificationContext(hanging))
    assert in_order((tmp_path / "report.html").read_text(), GRAVITY, "Fits the training recordings to within")


def test_the_same_of_a_diagnosis(diagnosed: Diagnosis, tmp_path: Path):
    content = diagnosis_dict(diagnosed)
    (doubt,) = content["doubts"]
    assert content["summary"][0] == doubt
    assert content["summary"].count(doubt) == 1
    noted = replace(diagnosed, notes=("what every result has",))
    assert in_order(noted.summary(), GRAVITY, "note: ", f"test_arm: {diagnosed.verdict}", "rms error")
    assert in_order(diagnosis_markdown(diagnosed, content=content), GRAVITY, "Error on the training recordings")
    diagnosis_report(tmp_path / "report.html", DiagnosisContext(diagnosed))
    assert in_order((tmp_path / "report.html").read_text(), GRAVITY, "No trajectory was repeated")


def test_efforts_that_count_backwards_stand_there_too_and_nothing_is_said_of_bodies(tmp_path: Path):
    robot, run = made(tmp_path, DOWN, DOWN)
    result = identify(robot, [replace(run, effort=-run.effort)], model="basic", bands=BANDS)
    first, others = headline_and_details(result)
    assert first == (f"{result.channels[0]}.",)
    assert "negate effort_gain" in first[0]
    assert not any("egate" in note for note in result.notes)
    assert not any("opposite sign" in said for said in others)
    assert in_order(result.summary(), "negate effort_gain", "meaning")


def test_a_right_arm_is_not_in_doubt_and_its_scale_is_reported_last(tmp_path: Path):
    robot, run = made(tmp_path, DOWN, DOWN)
    result = identify(robot, [run], model="basic", bands=BANDS)
    first, others = headline_and_details(result)
    assert first == ()
    assert others[-1].startswith("Recordings cannot determine a common scale")
    assert identification_dict(result)["doubts"] == []


def test_bodies_of_the_opposite_sign_are_a_doubt_where_friction_does_not_brake_and_said_once(tmp_path: Path):
    robot, run = made(tmp_path, DOWN, DOWN)
    result = identify(robot, [run], model="basic", bands=BANDS)
    scale = scale_in_words(result.estimate, result.training)
    assert "opposite sign" in scale and "but friction brakes there" in scale
    assert doubts(result.estimate, result.training, result.training, scale) == ()
    # Without friction nothing tells that efforts have the sign of the positions.
    robot, run = made(tmp_path, DOWN, DOWN, friction=0.0)
    result = identify(robot, [run], model="basic", bands=BANDS)
    assert turned_bodies(result.estimate, result.training) != ()
    first, others = headline_and_details(result)
    assert "negate effort_gain there" in first[0]
    assert others.count(first[0]) == 0
