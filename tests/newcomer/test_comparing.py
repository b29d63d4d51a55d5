"""What counts as shown, and what does not."""

import pytest

from tests.newcomer.comparing import difference


@pytest.mark.parametrize(
    ("shown", "output"),
    [
        ([], "anything"),
        (["left_knee   0.12  rad"], "left_knee  -3.5 rad"),
        (["…"], ""),
        (["{…, 1}"], '{"ready": true, 2}'),
        (["one", "…", "two", "three"], "one\ntwo\ntwo\nthree"),
        (["…", "TASK", "walk", "…"], "TASK\nTASK\nwalk\n"),
    ],
)
def test_it_is_as_shown(shown: list[str], output: str) -> None:
    assert difference(shown, output) is None


@pytest.mark.parametrize(
    ("shown", "output", "said"),
    [
        (["one"], "other", "'one' is not where it is shown"),
        (["one", "two"], "one\nelse\ntwo", "'one\\ntwo' is not where"),
        (["one"], "one\nmore", "'more' is not shown"),
        (["…", "one"], "two", "'one' is not where"),
        (["one", "…", "one"], "one", "'one' is not where"),
    ],
)
def test_a_difference_is_said(shown: list[str], output: str, said: str) -> None:
    assert said in str(difference(shown, output))
