"""A model comes out of its file as it went in, and what is no such file is said in a line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.use.known_model import KnownModel, read_known_model
from tests.arms import motion, sines


def test_a_file_gives_the_model_that_was_identified(known: KnownModel, result_file: Path):
    read = read_known_model(result_file)
    assert read.model.name == "complete"
    np.testing.assert_array_equal(read.value, known.value)
    assert read.bands == known.bands
    np.testing.assert_allclose(read.rms, known.rms, rtol=1e-6)


def test_parts_add_up_to_the_torque_of_the_estimate(identified, known: KnownModel):
    moved = motion(*sines(np.random.default_rng(0), np.arange(400) / 100.0, 2), rate=100.0)
    parts = known.torque_parts(moved)
    assert list(parts) == [
        "rigid body",
        *(f"{word} friction" for word in ("Coulomb", "viscous", "quadratic", "cubic")),
        "offset",
    ]
    expected = np.einsum("jpn,p->jn", identified.model.regressor(moved), identified.estimate.value)
    np.testing.assert_allclose(sum(parts.values()), expected, atol=1e-12)
    np.testing.assert_allclose(known.torque(moved), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (None, "cannot be read"),
        ("[", "not JSON"),
        ({}, "holds no model"),
        ({"model": "mine"}, "model 'mine'"),
        (
            {"parameters": [{"name": "P_d1", "joint": None, "meaning": "", "value": 1.0, "std": 1.0}]},
            "--robot of the arm",
        ),
        ("null", "parameter 'P_d2' has no value"),
    ],
)
def test_another_file_is_one_line(result_file: Path, tmp_path: Path, change, said: str):
    path = tmp_path / "identification.json"
    content = json.loads(result_file.read_text())
    if change == "null":
        content["parameters"][1] |= {"value": None, "std": None, "undetermined": True}
    elif change == {}:
        content = {}
    elif isinstance(change, dict):
        content |= change
    if change is not None:
        path.write_text(change if change == "[" else json.dumps(content))
    with pytest.raises(ScaraIdentError, match=said) as caught:
        read_known_model(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
