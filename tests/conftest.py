"""Settings of every test: property tests draw the same examples in every run unless told otherwise."""

from __future__ import annotations

import os

from hypothesis import settings

# A run that says yes or no must say the same for the same code. To look for new counterexamples:
# HYPOTHESIS_PROFILE=explore python -m pytest
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))
