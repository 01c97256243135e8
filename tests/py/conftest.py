"""What all tests share."""

import hypothesis
from shared import share_folder

share_folder()
# Hypothesis draws the same examples in every run.
hypothesis.settings.register_profile(
    "gslts", derandomize=True, deadline=None, max_examples=40, database=None
)
hypothesis.settings.load_profile("gslts")
