"""The notebook of the tutorial runs top to bottom, in an empty folder, and finds what it hid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.shared import PATIENCE, ROOT

NOTEBOOK = ROOT / "docs" / "tutorial.ipynb"

# Put behind the last cell: what the notebook's names hold, for the test to look at.
ASK = """
import json
print(json.dumps({
    "verdict": found.verdict,
    "effects": [[e.effect, e.joint, e.parameters["loss_coefficient"].value] for e in found.effects],
    "held_out": [estimate.errors(observations)[0].rms for estimate, observations in (
        (found.before, found.validation_before), (found.after, found.validation_after))],
    "parameters": [(base.grouping @ one.standard_parameters()).tolist() for one in (robot, identified, arm.robot)],
}))
"""


def cells() -> list[dict[str, Any]]:
    return list(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"])


def test_the_notebook_is_stored_with_what_its_cells_show() -> None:
    code = [cell for cell in cells() if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell["outputs"]]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 4
    assert "explained" in "".join(line for output in outputs for line in output.get("text", ()))
    # As `python docs/pictures.py notebook` stores them: small, and of no one's machine.
    assert {output.get("name", "stdout") for output in outputs} == {"stdout"}
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert len(text) < 400_000
    assert str(Path.home()) not in text and "/tmp/" not in text


def test_what_the_notebook_points_to_is_there() -> None:
    text = "".join("".join(cell["source"]) for cell in cells() if cell["cell_type"] == "markdown")
    targets = [part.split(")")[0] for part in text.split("](")[1:]]
    assert targets
    assert [target for target in targets if not (NOTEBOOK.parent / target).is_file()] == []


@pytest.mark.slow
def test_the_notebook_runs_top_to_bottom_and_finds_what_it_hid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="needs the extra test: pip install '.[test]'")
    nbclient = pytest.importorskip("nbclient", reason="needs the extra test: pip install '.[test]'")
    pytest.importorskip("ipykernel", reason="needs the extra test: pip install '.[test]'")
    # The reader's own settings of IPython and Jupyter take no part.
    for variable in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / "settings"))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    notebook.cells.append(nbformat.v4.new_code_cell(ASK))
    place = tmp_path / "reader"
    place.mkdir()
    nbclient.NotebookClient(notebook, timeout=PATIENCE, resources={"metadata": {"path": str(place)}}).execute()

    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert [output.text for output in outputs if output.output_type == "stream" and output.name == "stderr"] == []
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 4
    answer = json.loads(outputs[-1].text)
    ((effect, joint, loss),) = answer["effects"]
    assert (answer["verdict"], effect, joint) == ("explained", "transmission_loss", "joint1")
    assert loss == pytest.approx(0.25, rel=0.1)
    before, after = answer["held_out"]
    assert after < 0.9 * before
    mine, identified, true = answer["parameters"]
    # All but my2, which is zero.
    off = [
        [abs(value - truth) / truth for value, truth in zip(one, true, strict=True) if truth]
        for one in (mine, identified)
    ]
    assert max(off[1]) < 0.05
    assert sum(off[1]) < 0.5 * sum(off[0])
    # What it writes stays in a folder of its own.
    assert [path.name for path in place.iterdir()] == ["notebook-output"]
