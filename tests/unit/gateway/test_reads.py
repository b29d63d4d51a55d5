"""Whose parameters are read next: bounded for the devices, in turn for the clients, answered in order."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

import pytest

from gateway.messages import ParameterValue
from gateway.modules.reads import DEVICES, OBJECTS, Reads

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
        self.posted: list[Callable[[], None]] = []
        self.asked: list[tuple[list[Any], Future[list[ParameterValue]]]] = []
        self.reads = Reads(self, self._read_some)  # type: ignore[arg-type]

    def post(self, callback: Callable[[], None]) -> None:
        self.posted.append(callback)

    def _read_some(self, parameters: Sequence[Any]) -> "Future[list[ParameterValue]]":
        self.asked.append((list(parameters), Future()))
        return self.asked[-1][1]

    def answer(self, count: int = OBJECTS) -> list[str]:
        """The oldest of what the devices were asked for, `count` at most; what that was."""
        parameters, future = self.asked.pop(0)
        future.set_result([_value(one.name) for one in parameters[:count]])
        while self.posted:
            self.posted.pop(0)()
        return [one.name for one in parameters[:count]]


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


@pytest.mark.parametrize("count", [OBJECTS, 3, 1])
def test_it_is_answered_once_all_is_there_in_the_order_that_was_asked_for(bench: _Bench, count: int) -> None:
    """However few a device answers at once."""
    chosen = _everything()
    answer = bench.reads.ask(_Client("a"), chosen)
    while bench.asked:
        assert not answer.done()
        bench.answer(count)
    values = answer.result(0).values
    assert list(values) == [one.name for one in chosen]
    assert all(values[one.name] == _value(one.name) for one in chosen)


def test_nothing_asked_for_is_answered_at_once(bench: _Bench) -> None:
    assert bench.reads.ask(_Client("a"), []).result(0).values == {}


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


def test_a_device_that_is_slow_keeps_nobody_from_the_others(bench: _Bench) -> None:
    bench.reads.ask(_Client("a"), _of("left_hip", 100))
    slow = bench.asked.pop(0)
    answer = bench.reads.ask(_Client("b"), _of("left_knee", 20))
    while not answer.done():
        bench.answer()
    assert not slow[1].done()


def test_an_unforeseen_error_is_its_own_requests_and_the_next_goes_on(bench: _Bench) -> None:
    client = _Client("a")
    first, second = (bench.reads.ask(client, _of("left_hip", 1)) for _ in range(2))
    bench.asked.pop(0)[1].set_exception(ZeroDivisionError())
    while bench.posted:
        bench.posted.pop(0)()
    assert isinstance(first.exception(0), ZeroDivisionError)
    bench.answer()
    assert second.result(0).values
