"""Two devices with one node id answer each request twice; one frame that comes twice shows nothing."""

import itertools

from drivers.bus.sdo.duplicate_answers import CLEAN, RECENT, DuplicateAnswers


def answer(number: int, specifier: int = 0x43) -> bytes:
    return bytes([specifier]) + number.to_bytes(2, "little") + bytes(5)


def test_two_requests_in_a_row_that_are_answered_twice_show_it() -> None:
    doubles = DuplicateAnswers()
    doubles.answered(answer(1))
    assert doubles.again(answer(1))
    assert not doubles.found
    doubles.answered(answer(2))
    assert doubles.again(answer(2))
    assert doubles.found


def test_the_same_request_twice_shows_it_too() -> None:
    doubles = DuplicateAnswers()
    for _ in range(2):
        doubles.answered(answer(1))
        doubles.again(answer(1))
    assert doubles.found


def test_second_answers_that_come_during_later_requests_show_it() -> None:
    doubles = DuplicateAnswers()
    for number in range(RECENT):
        doubles.answered(answer(number))
    doubles.again(answer(1))
    doubles.again(answer(2))
    assert doubles.found


def test_single_frames_that_come_twice_show_nothing() -> None:
    doubles = DuplicateAnswers()
    for number in range(50):
        doubles.answered(answer(number))
        if number % 3 == 0:
            assert doubles.again(answer(number))
    assert not doubles.found


def test_an_answer_that_comes_three_times_shows_nothing() -> None:
    doubles = DuplicateAnswers()
    doubles.answered(answer(1))
    doubles.answered(answer(2))
    assert doubles.again(answer(2))
    assert not doubles.again(answer(2))
    assert not doubles.found


def test_an_answer_of_another_kind_or_object_is_no_second_one() -> None:
    doubles = DuplicateAnswers()
    doubles.answered(answer(1))
    assert not doubles.again(answer(1, 0x60))
    assert not doubles.again(answer(2))
    assert not doubles.again(b"\x03" + bytes(7))  # a segment


def test_it_is_over_after_a_run_of_requests_that_are_answered_once() -> None:
    doubles = DuplicateAnswers()
    numbers = itertools.count()
    for number in itertools.islice(numbers, 2):
        doubles.answered(answer(number))
        doubles.again(answer(number))
    for number in itertools.islice(numbers, CLEAN):
        doubles.answered(answer(number))
        assert doubles.found
    for number in itertools.islice(numbers, RECENT):
        doubles.answered(answer(number))
    assert not doubles.found
