"""A child process renders like its parent, however it was started."""

import multiprocessing

import pytest
import scenes


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_child_renders_what_its_parent_renders(method):
    expected = scenes.render_bytes(2)  # The pool has started before the child does.
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.apply_async(scenes.render_bytes, (2,)).get(timeout=60) == expected
    assert scenes.render_bytes(2) == expected
