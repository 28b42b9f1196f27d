"""What takes no part in an error is said, with the figures of the JSON."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.left_out import left_out_share, left_out_words


def test_the_share_is_that_of_samples_that_are_not_used(result):
    training = result.training_after
    used = sum(np.count_nonzero(part.used, axis=1) for part in training.data.stretches)
    samples = sum(part.samples for part in training.data.stretches)
    assert list(left_out_share(training).values()) == pytest.approx(list(1.0 - used / samples), abs=1e-9)


def test_the_words_have_the_figures_of_the_json(result):
    content = diagnosis_dict(result)
    assert content["left_out"]["training"] == left_out_share(result.training_after)
    assert content["left_out"]["validation"] == left_out_share(result.validation_after)
    told = {"left_out": {"training": {"j1": 0.112, "j2": 0.231}, "validation": {"j1": 0.2, "j2": 0.2}}}
    assert left_out_words(told) == (
        "Errors are for the time in which a joint moves: 11 to 23 % of the time, at rest, at reversals and at the ends "
        "of recordings, is left out."
    )
    assert "moves: 20 % of" in left_out_words({"left_out": {"training": {"j1": 0.2, "j2": 0.2}, "validation": {}}})
    assert left_out_words({"left_out": {"training": {}, "validation": {}}}) == ""
