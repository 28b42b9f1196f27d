"""The page of an identification."""

from __future__ import annotations

from scara_ident.report.html.identification import IdentificationContext, identification_report
from tests.report.html.document import document
from tests.report.simulated import made, run

SIGNALS = ("position", "velocity", "acceleration", "load", "time", "motor")


def test_an_identification_has_all_its_sections(identified):
    found = document(identified)
    # Two runs of one motion may seem to differ by chance, and have a section for it then.
    always = [section for section in found.sections if section != "variation"]
    assert always[:5] == ["prediction", "parameters", "friction", "residual", "convergence"]
    expected = {f"against-{signal}" for signal in SIGNALS}
    expected |= {"torque", "correlation", "frequency", "order", "lag", "friction-0", "friction-1"}
    expected |= {f"converge-{k}" for k in range(15)}
    assert expected <= set(found.figures)
    assert "The largest held-out error is on CI_1" in found.words
    assert "Predicts held-out recordings to within " in found.words


def test_a_fitted_and_a_held_out_run_of_one_name_both_stand_there(tmp_path):
    one, other = run("OJD_1", 1), run("OJD_1", 3, start=4.0)
    identification_report(tmp_path / "report.html", IdentificationContext(made([one], [other])))
    words = document(tmp_path / "report.html").words
    assert "OJD_1 (fitted)" in words
    assert "OJD_1 (held out)" in words
