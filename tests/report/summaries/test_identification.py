"""What an identification tells."""

from __future__ import annotations

from tests.results import Results


def test_an_identification_tells_parameters_errors_and_sentences(results: Results):
    text = results.identification.summary()
    assert "rms error within the band [N m], fitted" in text
    assert "rms error within the band [N m], held out" in text
    assert "band: joint1 25 Hz, joint2 25 Hz; J_d" in text
    assert "The largest held-out error is on OJK_1" in " ".join(text.split())
    assert all(f"note: {note}"[:60] in text for note in results.identification.notes)


def test_its_figure_is_of_the_torque_of_every_recording_and_joint(results: Results):
    figure = results.identification.plot()
    titles = {text.get_text() for text in figure.texts}
    assert {"OJK_1 (held out), joint1", "OJD_2 (fitted), joint2"} <= titles
