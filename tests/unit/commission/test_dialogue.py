"""A dialogue takes what will do, and asks again for what will not."""

from collections.abc import Iterator

import pytest

from gateway.commission.dialogue import Ask, Say, Talk, agree, choose, number, run, word


class Typed:
    """Somebody who types these lines, and reads."""

    def __init__(self, *lines: str) -> None:
        self._lines: Iterator[str] = iter(lines)
        self.read: list[str] = []

    def say(self, text: str) -> None:
        self.read.append(text)

    def moving(self, text: str) -> str:
        raise AssertionError(f"nobody agreed to a motion: {text}")

    def ask(self, question: Ask) -> str:
        try:
            return next(self._lines)
        except StopIteration:
            raise EOFError from None


def test_a_number_out_of_range_is_told_and_asked_for_again() -> None:
    face = Typed("", "much", "nan", "400", "12.5°")
    assert run(number("How far?", "°", 0, 90), face) == 12.5
    assert len(face.read) == 4
    assert "0 to 90 °" in face.read[0]


def test_an_empty_answer_is_the_default_where_there_is_one() -> None:
    assert run(number("How far?", "°", 0, 90, 3), Typed("")) == 3
    assert run(word("Who?", "Ada"), Typed("")) == "Ada"
    assert run(choose("Which?", ("again", "angles"), "again"), Typed("")) == "again"
    assert run(agree("Write?"), Typed("")) is False


def test_the_beginning_of_a_choice_will_do_where_it_is_the_only_one() -> None:
    face = Typed("a", "ang")
    assert run(choose("Which?", ("again", "angles", "drive")), face) == "angles"
    assert "none of again, angles, drive" in face.read[0]


@pytest.mark.parametrize(("typed", "agreed"), [("y", True), ("YES", True), ("yep", False), ("n", False)])
def test_only_a_yes_is_a_yes(typed: str, agreed: bool) -> None:
    assert run(agree("Write?"), Typed(typed)) is agreed


def test_what_was_begun_is_ended_when_nobody_answers_any_more() -> None:
    ended = []

    def talk() -> Talk[None]:
        try:
            yield Say("begun")
            yield Ask("and?")
        finally:
            ended.append(True)

    with pytest.raises(EOFError):
        run(talk(), Typed())
    assert ended == [True]
