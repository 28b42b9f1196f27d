"""Identifications for the tests of what a model is for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scara_ident.export.identified_model import IdentifiedModel, identified_model
from scara_ident.files import plain
from scara_ident.identification.identify import Identification
from scara_ident.report.identification import identification_dict
from tests.report.simulated import made, run


@pytest.fixture(scope="session")
def identified() -> Identification:
    return made([run("OJD_1", 1), run("OJD_2", 2)], [run("CI_1", 3, start=4.0)], bands=[15.0, 15.0])


@pytest.fixture(scope="session")
def known(identified: Identification) -> IdentifiedModel:
    return identified_model(identified)


@pytest.fixture(scope="session")
def result_file(identified: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("result") / "identification.json"
    path.write_text(json.dumps(plain(identification_dict(identified))))
    return path
