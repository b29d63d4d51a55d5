"""The header at every width: nothing in it lies over anything else, whatever it has just been told."""

import itertools
import time
from collections.abc import Callable, Iterator

import pytest
from PySide6.QtWidgets import QApplication, QPushButton, QWidget

from server_gui.core.desk.recording import Said, Tone
from server_gui.views.frame.header import Header
from server_gui.views.frame.recording_chip import _words
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Around, Bench, destroy
from tests.gui.test_rules import (
    _fault,
    _link_lost,
    _never_reached,
    _stop_lost,
    _stopped,
    _unconfirmed,
    _walks,
)
from tests.support.desk import JOINTS, looked, telemetry

LEAST = 1024  # wide, where every number has room
WIDTHS = (*range(320, 1000, 120), LEAST, 1366, 1920)
STATES = (_walks, _link_lost, _never_reached, _fault, _stopped, _unconfirmed, _stop_lost)


@pytest.fixture
def header(bench: Bench, theme: Theme) -> Iterator[Header]:
    made = Header(bench.desk, theme, QPushButton("View"))
    made.show()
    yield made
    destroy(made)


def test_without_a_robot_stop_is_of_the_one_that_is_commissioned_as_its_key_is(
    header: Header, bench: Bench
) -> None:
    bench.desk.selected = None
    bench.draw(header)
    assert not header.stop.isEnabled()
    header.commissioned = lambda: "exo-01"
    bench.draw(header)
    assert header.stop.isEnabled()
    assert "exo-01" in header.stop.accessibleName()


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_chips_never_overlap(bench: Bench, theme: Theme, header: Header, scale: float) -> None:
    theme.set(scale=scale)
    broken = []
    for state, width in itertools.product(STATES, WIDTHS):
        header.resize(width, header.height())
        if width == WIDTHS[0]:
            _told(bench, state)
        header.refresh()  # a slow window is drawn as it is now, before Qt's own events
        if width >= header.minimumSizeHint().width():
            broken += [f"{state.__name__} {width}: {one}" for one in _overlaps(header)]
            QApplication.processEvents()
            broken += [f"{state.__name__} {width}, settled: {one}" for one in _overlaps(header)]
            halved = rules.halved_numbers(header) if width >= LEAST else []
            broken += [f"{state.__name__} {width}: {one}" for one in halved]
    assert not broken, "\n".join(broken)


def _shown(
    header: Header, bench: Bench, theme: Theme, state: Callable[[Bench], None], width: int, scale: float
) -> None:
    """As the window shows it at this size."""
    theme.set(scale=scale)
    header.be_short(width < theme.px(1200))
    header.resize(width, header.height())
    _told(bench, state)
    header.refresh()


@pytest.mark.parametrize(("width", "scale"), [(1024, 1.5), (1024, 1.0), (1366, 1.5), (1920, 1.0)])
@pytest.mark.parametrize("state", [_walks, _link_lost, _fault])
def test_age_and_recording_are_in_sight_beside_stop_however_large_the_text_is(
    bench: Bench, theme: Theme, header: Header, state: Callable[[Bench], None], width: int, scale: float
) -> None:
    _shown(header, bench, theme, state, width, scale)
    shown = {name: chip.main_text for name, chip in header._chips.items() if chip.isVisible()}
    assert {"robot", "drives", "link", "recording"} <= shown.keys(), shown
    assert shown["recording"] in ("Not recording", "REC off")
    assert not rules.halved_numbers(header)


@pytest.mark.parametrize(("width", "scale"), [(1024, 1.0), (1024, 1.5), (1024, 2.0), (1366, 1.5)])
@pytest.mark.parametrize("state", [_unconfirmed, _stop_lost])
def test_age_is_in_sight_beside_a_stop_that_is_not_confirmed(
    bench: Bench, theme: Theme, header: Header, state: Callable[[Bench], None], width: int, scale: float
) -> None:
    """There was none at all: the robot's chip had the room, and most of it empty."""
    _shown(header, bench, theme, state, width, scale)
    link, robot = header._chips["link"], header._chips["robot"]
    assert link.isVisible()
    assert "old" in f"{link.main_text} {link.detail_text}"
    words = robot._detail.fontMetrics().horizontalAdvance(robot.detail_text)
    assert not robot.isVisible() or words > robot.width() / 2, "no wider than its words need"


def test_a_name_is_whole_as_long_as_others_can_say_less(bench: Bench, theme: Theme, header: Header) -> None:
    """It was cut in its middle beside a chip that was wider than its words."""
    bench.station.name, bench.station.is_named = "exo-rehab-center-left-01", True
    header.resize(1366, header.height())
    _told(bench, _walks)
    header.refresh()
    QApplication.processEvents()
    robot = header._chips["robot"]
    assert robot.width() >= robot.whole
    header.resize(900, header.height())
    header.refresh()
    QApplication.processEvents()
    assert not _overlaps(header), "what cannot be whole gives way as before"


def test_a_recording_of_which_nothing_is_known_is_not_said_to_be_off(header: Header, bench: Bench) -> None:
    said = Said(Tone.OFF, "Recording: not known yet", brief="REC ?")
    for brief, text in ((False, said.text), (True, said.brief)):
        header.recording.be_brief(brief)
        header.recording.say(_words(bench.desk.recording, said, None))
        assert header.recording.main_text == text


def test_a_chip_says_why_it_is_not_recorded_or_not_judged(header: Header, bench: Bench) -> None:
    """There was nothing below `NOT RECORDING`, `Recording` and `Not judged`."""
    header.resize(1366, header.height())
    now_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    states["left_knee.state"] = [None]
    bench.look_again([looked(), telemetry([now_ns], states, now_ns)])
    header.refresh()
    status = header._chips["status"]
    assert status.main_text == "Not judged"
    assert "drives not known" in status.detail_text
    bad = Said(Tone.BAD, "NOT RECORDING", "the spool cannot be read", reason="its folder is missing")
    coming = Said(Tone.WARNING, "Recording · nothing comes · spool 1.8 MiB · all uploaded", brief="REC")
    for said, why in ((bad, bad.reason), (coming, "nothing comes")):
        words = _words(bench.desk.recording, said, None)
        chip = header.recording
        for is_brief in (False, True):
            chip.be_brief(is_brief)
            chip.say(words)
            chip.resize(chip.wants, chip.height())
            assert chip.detail_text.startswith(why)
    narrow = chip.needs(brief=True)
    chip.resize(narrow, chip.height())
    assert chip.main_text == "REC"
    assert "…" not in chip.detail_text


def _told(bench: Bench, state: Callable[[Bench], None]) -> None:
    bench.desk.select(bench.desk.stations[0])
    state(bench)


def _overlaps(header: Header) -> list[str]:
    parts = [one for one in header.children() if isinstance(one, QWidget) and one.isVisible()]
    pairs = itertools.combinations(parts, 2)
    found = [f"{_name(one)} over {_name(other)}" for one, other in pairs if _meet(one, other)]
    return found + [f"{_name(one)} outside" for one in parts if not header.rect().contains(one.geometry())]


def _meet(one: QWidget, other: QWidget) -> bool:
    return one.geometry().intersects(other.geometry())


def _name(one: QWidget) -> str:
    return one.accessibleName() or type(one).__name__


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("name", ["walker", "exo-07-of-the-2nd-laboratory-behind-the-stairs-3"])
def test_it_is_always_said_which_robot_is_looked_at_and_how_it_is(
    bench: Bench, theme: Theme, header: Header, scale: float, name: str
) -> None:
    theme.set(scale=scale)
    bench.station.name, bench.station.is_named = name, True
    header.be_short(True)
    header.resize(LEAST, header.height())
    for state in STATES:
        _told(bench, state)
        header.refresh()
        QApplication.processEvents()
        chip = header._chips["robot"]
        if header.outcome_text and not chip.isVisible():  # the age has the room, and STOP has the name
            assert "".join(header.stop.lines).replace(" ", "") == name
            continue
        assert chip.isVisible(), state.__name__
        assert chip.main_text == name or state is _never_reached
        assert chip.detail_text, state.__name__
        assert header.stop.is_whole
        halved = rules.halved_numbers(header)
        assert halved == [], state.__name__


def test_where_a_drive_is_not_known_the_chip_says_what_the_others_do(around: Around, bench: Bench) -> None:
    now_ns = time.monotonic_ns()
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    states["left_knee.state"] = [None]
    bench.station.take([telemetry([now_ns], states, now_ns)])
    bench.draw(around)
    words = around.header._chips["drives"]._words
    assert (words.main, words.parts[0]) == ("1 of 6 drives not known", "5 off")


def test_a_chip_does_not_change_its_form_with_each_second(header: Header, bench: Bench) -> None:
    """The button that ends a recording came and went under the pointer."""
    bench.station.take([telemetry([time.monotonic_ns()], {"left_knee.position": [0.1]}), looked()])
    said = Said(Tone.GOOD, "Recording 4:47", "", "REC", "")
    header.recording.say(_words(bench.desk.recording, said, None))
    forms = []
    for room in range(300, 900):
        both = []
        for before in (frozenset[str](), frozenset({"recording"})):
            header._was_brief = before
            header._shared(list(header._chips), room)
            both.append("recording" in header._was_brief)
        forms.append(tuple(both))
    assert (False, True) in forms, "what is brief stays so where there is hardly more room"
    assert forms[-1] == (False, False), "and comes back where there is"
    assert (True, False) not in forms
