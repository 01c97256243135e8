"""Setup of all tests: threads, the folder of the run, Hypothesis, and the marker `system`."""

import os
from pathlib import Path

import hypothesis
import pytest

SYSTEM = Path(__file__).parent / "system"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Threads of libraries spin while they wait, which takes the core of other test processes."""

# Hypothesis draws the same examples in every run.
hypothesis.settings.register_profile(
    "gslts", derandomize=True, deadline=None, max_examples=40, database=None
)
hypothesis.settings.load_profile("gslts")


def pytest_configure() -> None:
    """Set what must be known before numpy is imported, and make the folder of the run."""
    for variable in ONE_THREAD:
        os.environ.setdefault(variable, "1")
    from shared import share_folder

    share_folder()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of whole pipelines by their folder."""
    for item in items:
        if SYSTEM in item.path.parents:
            item.add_marker(pytest.mark.system)
