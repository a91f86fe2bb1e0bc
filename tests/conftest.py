"""Settings of all tests."""

from __future__ import annotations

import os

from hypothesis import settings

# The same examples every time, so that a red test is a change; HYPOTHESIS_PROFILE=explore looks for new ones.
settings.register_profile("repeat", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeat"))
