"""Whose parameters are read next: bounded for the devices, in turn for the clients, answered in order."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

import pytest

from gateway.modules.control import reads
from gateway.modules.control.reads import DEVICES, OBJECTS, Reads
from gateway.wire.parameter import ParameterValue

DEVICE_NAMES = ("left_hip", "left_knee", "right_hip", "right_knee")


class _Parameter:
    def __init__(self, component: str, number: int) -> None:
        self.component, self.name = component, f"{component}.{number}"


class _Client:
    def __init__(self, address: str) -> None:
        self.address, self.closed = address, False
        self.farewells: dict[object, Callable[[], None]] = {}

    def on_close(self, farewell: Callable[[], None], whose: object = None) -> None:
        self.farewells[whose] = farewell

    def leave(self) -> None:
        self.closed = True
        for farewell in self.farewells.values():
            farewell()


class _Bench:
    """The loop's turns and the devices' answers are the test's."""

    def __init__(self) -> None:
        self.refuses = False
        self.posted: list[Callable[[], None]] = []
        self.asked: list[tuple[list[Any], Future[list[ParameterValue]]]] = []
        self.reads = Reads(self, lambda one: one.component, self._read_all)  # type: ignore[arg-type]

    def post(self, callback: Callable[[], None]) -> None:
        self.posted.append(callback)

    def _read_all(self, parameters: Sequence[Any]) -> "Future[list[ParameterValue]]":
        if self.refuses:
            raise ZeroDivisionError
        self.asked.append((list(parameters), Future()))
        return self.asked[-1][1]

    def answer(self, device: str | None = None) -> list[str]:
        """The oldest of what the devices were asked for; what that was."""
        at = next(at for at, (asked, _) in enumerate(self.asked) if device in (None, asked[0].component))
        parameters, future = self.asked.pop(at)
        future.set_result([_value(one.name) for one in parameters])
        self.turn()
        return [one.name for one in parameters]

    def turn(self) -> None:
        while self.posted:
            self.posted.pop(0)()


@pytest.fixture
def bench() -> _Bench:
    return _Bench()


def _value(name: str) -> ParameterValue:
    return ParameterValue(float(name.rpartition(".")[2]), "", None, None, 1)


def _everything(count: int = 30) -> list[Any]:
    return [_Parameter(device, number) for number in range(count) for device in DEVICE_NAMES]


def _of(device: str, count: int) -> list[Any]:
    return [_Parameter(device, number) for number in range(count)]


def test_a_few_objects_of_a_few_devices_are_asked_for_at_a_time(bench: _Bench) -> None:
    bench.reads.ask(_Client("a"), _everything())
    while bench.asked:
        devices = [parameters[0].component for parameters, _future in bench.asked]
        assert len(devices) <= DEVICES
        assert len(set(devices)) == len(devices)
        for parameters, _future in bench.asked:
            assert len(parameters) <= OBJECTS
            assert len({one.component for one in parameters}) == 1
        bench.answer()


def test_it_is_answered_once_all_is_there_in_the_order_that_was_asked_for(bench: _Bench) -> None:
    chosen = _everything()
    answer = bench.reads.ask(_Client("a"), chosen)
    while bench.asked:
        assert not answer.done()
        bench.answer()
    values = answer.result(0)
    assert list(values) == [one.name for one in chosen]
    assert all(values[one.name] == _value(one.name) for one in chosen)


def test_nothing_asked_for_is_answered_at_once(bench: _Bench) -> None:
    assert bench.reads.ask(_Client("a"), []).result(0) == {}


def test_one_that_asks_for_everything_again_and_again_does_not_keep_another_waiting(bench: _Bench) -> None:
    greedy = [_Client("greedy") for _ in range(10)]
    for client in greedy * 5:
        bench.reads.ask(client, _everything())
    answer = bench.reads.ask(_Client("other"), _everything(OBJECTS))
    answered = 0
    while not answer.done():
        bench.answer()
        answered += 1
    assert answered <= DEVICES + 3 * len(DEVICE_NAMES)  # what was under way, and then in turn


def test_clients_of_one_address_take_turns_too(bench: _Bench) -> None:
    for _ in range(50):
        bench.reads.ask(greedy := _Client("tunnel"), _everything())
        bench.reads.ask(greedy, _everything())
    answer = bench.reads.ask(_Client("tunnel"), _everything(1)[:1])
    answered = 0
    while not answer.done():
        bench.answer()
        answered += 1
    assert answered <= 55


def test_a_client_is_answered_in_the_order_of_its_requests(bench: _Bench) -> None:
    client = _Client("a")
    answers = [bench.reads.ask(client, _everything(3)) for _ in range(4)]
    while not answers[-1].done():
        states = [answer.done() for answer in answers]
        assert states == sorted(states, reverse=True)
        bench.answer()


def test_what_a_client_that_has_gone_asked_for_is_not_read(bench: _Bench) -> None:
    gone, here = _Client("a"), _Client("b")
    bench.reads.ask(gone, _everything())
    answer = bench.reads.ask(here, _everything(2))
    gone.leave()
    bench.answer(), bench.answer()  # was under way
    read = [name for _ in range(len(DEVICE_NAMES)) for name in bench.answer()]
    assert answer.done()
    assert len(read) == 2 * len(DEVICE_NAMES)
    assert not bench.asked


def test_devices_that_are_slow_keep_nobody_from_the_others(
    bench: _Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = ("left_hip", "right_hip", "right_knee")
    for device in slow:
        bench.reads.ask(_Client(device), _of(device, 100))
    monkeypatch.setattr(reads, "SLOW_S", 0.0)
    for device in slow:  # each is known to be slow once it has been waited for
        bench.answer(device)
    monkeypatch.setattr(reads, "SLOW_S", 1000.0)
    answer = bench.reads.ask(_Client("b"), _of("left_knee", 20))
    while not answer.done():
        bench.answer("left_knee")
    assert {asked[0].component for asked, _future in bench.asked} == set(slow)


def test_an_unforeseen_error_is_its_own_requests_and_the_next_goes_on(bench: _Bench) -> None:
    client = _Client("a")
    first, second = (bench.reads.ask(client, _of("left_hip", 1)) for _ in range(2))
    bench.asked.pop(0)[1].set_exception(ZeroDivisionError())
    bench.turn()
    assert isinstance(first.exception(0), ZeroDivisionError)
    bench.answer()
    assert second.result(0)


def test_two_errors_of_one_request_are_one_answer_and_the_next_goes_on(bench: _Bench) -> None:
    first = bench.reads.ask(_Client("a"), [*_of("left_hip", 1), *_of("left_knee", 1)])
    second = bench.reads.ask(_Client("b"), _of("left_hip", 1))
    for _parameters, future in bench.asked[:2]:
        future.set_exception(ZeroDivisionError())
    del bench.asked[:2]
    bench.turn()
    assert isinstance(first.exception(0), ZeroDivisionError)
    bench.answer()
    assert second.result(0)


def test_a_device_whose_reading_cannot_begin_is_not_busy_for_ever(bench: _Bench) -> None:
    bench.refuses = True
    first = bench.reads.ask(_Client("a"), _of("left_hip", 1))
    bench.turn()
    assert isinstance(first.exception(0), ZeroDivisionError)
    bench.refuses = False
    second = bench.reads.ask(_Client("a"), _of("left_hip", 1))
    bench.answer()
    assert second.result(0)
