"""gwrms top tells what the program that records here has learned from the robot's wearer."""

import threading
from pathlib import Path

import pytest

from server_gui.core.fleet.control_socket import NobodyCollects
from server_gui.terminal.adapted_models import Learned
from tests.support.terminal_robot import a_station, screen
from tests.support.waiting import until

TOLD = "learned from P01: serves since 14:32 (3.4 → 2.1 %); “Take back” in the window"


def report(name: str, address: str, calls_itself: str | None) -> bytes:
    known = "null" if calls_itself is None else f'"{calls_itself}"'
    robot = f'"{name}": {{"address": "{address}", "calls_itself": {known}, "rows": 1}}'
    return f'{{"robots": {{{robot}}}, "prediction": {{"adapting": {{"{name}": "{TOLD}"}}}}}}'.encode()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (report("walker", "127.0.0.1:7420", None), TOLD),
        (report("walker", "192.0.2.7:7420", "exo-01"), TOLD),
        (report("exo-01", "192.0.2.7:7420", None), TOLD),
        (report("exo-02", "192.0.2.7:7420", "exo-02"), ""),
        (b'{"robots": 7}', ""),
        (b"", ""),
        (b'{"prediction": null}', ""),
    ],
)
def test_what_was_learned_is_told_of_this_robot_alone(tmp_path: Path, answer: bytes, told: str) -> None:
    station = a_station()
    asked = []

    def asking(folder: Path, what: str) -> bytes:
        asked.append((folder, what))
        return answer

    with Learned(tmp_path, asking) as learned:
        learned.look(station)
        until(lambda: learned._answer is not None and learned._answer.done(), "was answered")
        learned.look(station)
        learned.look(station)
    assert asked == [(tmp_path, "status")], "it is asked again before its time"
    assert station.predictions.elsewhere == told
    for size in ((118, 27), (80, 24)):
        assert (told in screen(station, size=size)) is True
        assert "no data yet" in screen(station, size=size).splitlines()[-1], "the last lines are cut"


def test_who_hangs_or_does_not_record_holds_nobody_up(tmp_path: Path) -> None:
    station, let_go = a_station(), threading.Event()
    station.predictions.elsewhere = "what was said before"

    def hangs(_folder: Path, _what: str) -> bytes:
        let_go.wait()
        raise NobodyCollects("nobody")

    with Learned(tmp_path, hangs) as learned:
        for _ in range(3):
            learned.look(station)
        assert station.predictions.elsewhere == "what was said before"
        let_go.set()
        until(lambda: learned._answer is not None and learned._answer.done(), "had an end")
        learned.look(station)
    assert station.predictions.elsewhere == ""
