"""Problems of a node are logged once, and again only if they last."""

from gslts.ros.constants import SAY_AGAIN_S
from gslts.ros.problems import Problems


class Clock:
    """Moves by hand."""

    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_a_problem_that_lasts_is_logged_at_most_every_ten_seconds() -> None:
    said: list[str] = []
    clock = Clock()
    problems = Problems(said.append, clock)
    for _ in range(300):
        problems.report("/image", "too small")
        clock.now_s += 0.1
    assert said == ["/image: too small"] * 3


def test_alternating_problems_do_not_fill_the_log() -> None:
    said: list[str] = []
    clock = Clock()
    problems = Problems(said.append, clock)
    for number in range(100):
        problems.report("/image", f"stamp {number}")
        clock.now_s += 0.1
    assert len(said) <= 100 * 0.1 / (SAY_AGAIN_S / 10) + 1


def test_subjects_are_independent_and_problems_end() -> None:
    said: list[str] = []
    clock = Clock()
    problems = Problems(said.append, clock)
    problems.report("/image", "too small")
    problems.report("/tf", "a loop")
    assert len(said) == 2
    assert problems.present() == {"/image": "too small", "/tf": "a loop"}
    clock.now_s += SAY_AGAIN_S
    assert problems.present() == {}
