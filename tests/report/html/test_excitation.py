"""The page of an excitation."""

from __future__ import annotations

from tests.report.html.document import document


def test_a_broken_limit_is_said_at_the_top(excited):
    assert "Broken limits: joint1.velocity." in document(excited).words
