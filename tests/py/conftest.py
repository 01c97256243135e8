"""Hypothesis draws the same examples in every run."""

import hypothesis

hypothesis.settings.register_profile(
    "gslts", derandomize=True, deadline=None, max_examples=40, database=None
)
hypothesis.settings.load_profile("gslts")
