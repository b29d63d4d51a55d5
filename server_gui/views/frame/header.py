"""Always in sight: robot, drives, status, link, what became of a STOP, and STOP itself."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from gateway.amounts import counted
from gateway.wire.stop import ROBOT_RESET
from server_gui.core.alarms.drive_states import listed
from server_gui.core.alarms.texts import TEXTS
from server_gui.core.alarms.unconfirmed import enabled_again, enabled_mark, remedy, unstopped
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.stop import ENABLED, StopState, is_off
from server_gui.views.frame.chip import Chip, Words
from server_gui.views.frame.recording_chip import NAME, RecordingChip
from server_gui.views.marks import SHORTER, Mark, age_text, drives_mark, enabled_text
from server_gui.views.predictions import OLD, by_steps, is_last_held, no_data, status
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.stop_button import StopButton

STOP_MARKS: Final = {
    StopState.SENT: Mark("half", "warn", "sent"),
    StopState.CONFIRMED: Mark("triangle", "warn", "STOPPED"),
}
STOP_SHARE: Final = 0.4  # of the width, which STOP may take at most
RESETTING: Final = "Ends a held stop. Every drive stays switched off: nothing is enabled."
# Brief, and then left out, in this order where there is less room; alarms stand below the header.
SPARE_PX: Final = 24  # at text of 100 %: what is brief stays so until there is more than just room
BRIEF: Final = ("recording", "link", "drives")
SPARE: Final = ("status", "recording", "link", "drives", "robot")
# Its result tells of the drives, and STOP has the robot's name: the age of what is seen goes last.
SPARE_AFTER_STOP: Final = ("status", "recording", "drives", "robot", "link")
LEAST_NAME: Final = 100  # wide, at text of 100 %: room for the state STOPPED
A_NAME: Final = 130  # wide, at text of 100 %: a longer name of a robot is elided in its middle


class Header(QWidget):
    """`stopped` asks for a STOP of the robot that is looked at, `reset` to end the one of a station."""

    stopped = Signal()
    reset = Signal(object)

    def __init__(self, desk: Desk, theme: Theme, menu: QPushButton) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.setObjectName("header")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._brand = PlainLabel("GWRMS")
        self._brand.setObjectName("brand")
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(12, 5, 12, 5)
        self._row.setSpacing(8)
        self._row.addWidget(self._brand)
        self._chips = {name: Chip(theme, name, most=A_NAME if name == "robot" else 0) for name in _WORDS}
        self._chips[NAME] = self.recording = RecordingChip(desk, theme)
        self._outcome = Chip(theme, "what became of the STOP")
        for chip in (*self._chips.values(), self._outcome):
            self._row.addWidget(chip, 1)
        self._empty = QWidget()  # takes the room where there is no chip
        self._row.addWidget(self._empty, 1)
        self.reset_button = QPushButton("Reset stop…")
        set_tip(self.reset_button, RESETTING)
        self.reset_button.clicked.connect(lambda: self.reset.emit(self._desk.selected))
        self._row.addWidget(self.reset_button)
        self.menu = menu
        self._row.addWidget(menu)
        self._was_brief: frozenset[str] = frozenset()  # at the last fit, in a window of this width
        self.commissioned: Callable[[], str] = lambda: ""  # the robot that is: its STOP is ours, too
        self.stop = StopButton()
        self.stop.stopped.connect(self.stopped)
        self._row.addWidget(self.stop)
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def outcome_text(self) -> str:
        """Result of the STOP as shown; empty without one."""
        return self._outcome.main_text if not self._outcome.isHidden() else ""

    def minimumSizeHint(self) -> QSize:
        """Size of the parts that are always shown."""
        return QSize(
            self.width() - self._room(has_outcome=self._has_outcome), super().minimumSizeHint().height()
        )

    def be_short(self, is_short: bool) -> None:
        """Leave out what says nothing of the robot, where there is little room."""
        self._brand.setVisible(not is_short)
        self._fit()

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        if station is not None:
            for name, words in _WORDS.items():
                self._chips[name].say(words(station))
            self.recording.refresh()
        self._refresh_stop(station)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._was_brief = frozenset()
        self._fit()

    def _refresh_stop(self, station: Station | None) -> None:
        name = self.commissioned() if station is None else station.title
        self.stop.name(name or None)
        self.stop.setEnabled(bool(name))  # as the key does it
        stopping = None if station is None else station.stopping
        self.reset_button.setVisible(stopping is not None and stopping.held)
        why_not = "" if station is None else station.refused(ROBOT_RESET)
        self.reset_button.setEnabled(not why_not)
        set_tip(self.reset_button, why_not or RESETTING)
        if station is not None:
            self._outcome.say(_outcome(station))

    def _fit(self) -> None:
        """Show as many chips as have room for all of their first line, and give each what it needs."""
        station = self._desk.selected
        self.stop.allow(max(round(self.width() * STOP_SHARE), self._theme.px(150)))
        self._empty.setVisible(station is None)
        has_outcome = self._has_outcome
        shown = [] if station is None else list(self._chips)
        needs = self._shared(shown, self._room(has_outcome=has_outcome))
        for name, chip in self._chips.items():
            chip.setVisible(name in needs)
            chip.setMinimumWidth(needs.get(name, 0))
            self._row.setStretchFactor(chip, chip.wants if name in needs and name != "robot" else 0)
        self._outcome.setVisible(has_outcome)
        self._outcome.setMinimumWidth(self._outcome.needs() if has_outcome else 0)
        self._row.setStretchFactor(self._outcome, self._outcome.wants if has_outcome else 0)
        self._row.activate()  # at once: what is wider now would lie over its neighbour until the next event

    def _shared(self, shown: list[str], room: int) -> dict[str, int]:
        """Return how wide each chip is that has room.

        Where there is little, some are brief, the robot's name gives way, and at last a chip is left out.
        """
        chips, spacing = self._chips, self._row.spacing()
        needs = {name: chips[name].needs() for name in shown}
        brief: set[str] = set()

        def has_room(name: str = "") -> bool:
            spare = self._theme.px(SPARE_PX) if name in self._was_brief else 0
            return sum(needs.values()) + len(needs) * spacing + spare <= room

        for name in BRIEF:
            if name in needs and not has_room(name):
                brief.add(name)
                needs[name] = chips[name].needs(brief=True)
        if "robot" in needs and not has_room():
            needs["robot"] = min(needs["robot"], max(chips["robot"].least, self._theme.px(LEAST_NAME)))
        spared = {}
        for name in SPARE_AFTER_STOP if self._has_outcome else SPARE:
            if name in needs and not has_room():
                spared[name] = needs.pop(name)
        for name in reversed(spared):  # a wider one than needed may have gone after it
            needs[name] = spared[name]
            if not has_room():
                del needs[name]
        for name in ("robot", *BRIEF):  # as wide again as it may be without what is left out
            least = needs.get(name, 0)
            if least:
                needs[name] = chips[name].needs()
                if has_room(name):
                    brief.discard(name)
                else:
                    needs[name] = least
        if "robot" in needs:
            self._whole_name(needs, brief, room)
            needs["robot"] += chips["robot"].more((room - sum(needs.values()) - len(needs) * spacing) // 2)
        for name in BRIEF:
            chips[name].be_brief(name in brief)
        self._was_brief = frozenset(brief)
        return needs

    def _whole_name(self, needs: dict[str, int], brief: set[str], room: int) -> None:
        """Give the robot's name all that it needs, if others that say less make room; else what is left."""
        around = len(needs) * self._row.spacing()
        wider, briefer = {**needs, "robot": self._chips["robot"].whole}, set(brief)
        for name in BRIEF:
            if name in wider and sum(wider.values()) + around > room:
                briefer.add(name)
                wider[name] = self._chips[name].needs(brief=True)
        if sum(wider.values()) + around <= room:
            needs.update(wider)
            brief |= briefer
        else:
            needs["robot"] += max(0, room - sum(needs.values()) - around)

    @property
    def _has_outcome(self) -> bool:
        station = self._desk.selected
        stopping = None if station is None else station.stopping
        return stopping is not None and (stopping.state is not StopState.IDLE or stopping.held)

    def _room(self, *, has_outcome: bool) -> int:
        """Return the width left for the chips."""
        margins, spacing = self._row.contentsMargins(), self._row.spacing()
        fixed = [self._brand, self.reset_button, self.menu, self.stop]
        taken = sum(one.sizeHint().width() + spacing for one in fixed if not one.isHidden())
        taken += self._outcome.needs() + spacing if has_outcome else 0
        return self.width() - margins.left() - margins.right() - taken

    def _restyle(self) -> None:
        self.stop.setFont(self._theme.text_font(1.45, bold=True))
        self._brand.setFont(self._theme.text_font(1.5, bold=True))
        self.stop.setMinimumWidth(self._theme.px(150))
        self._fit()


def _outcome(station: Station) -> Words:
    stopping = station.stopping
    kind = unstopped(station.robot, stopping)
    if kind is not None:
        mark, to_do = TEXTS[kind].mark, remedy(station.robot, stopping)
        again = listed(enabled_again(station.robot, stopping))
        told = f"{mark.word}: {again}" if again else ""
        tip = "\n".join(filter(None, (told, stopping.text, *stopping.proof_lines)))
        return Words(mark, mark.word, to_do, tip)
    if stopping.state is StopState.IDLE:
        mark, main = Mark("triangle", "warn", "STOPPED"), "STOP held"
        said = "; ".join(filter(None, stopping.said))
        return Words(mark, main, ("until it is reset",), f"STOP held: {said}")
    tip = "\n".join(filter(None, (stopping.text, *stopping.proof_lines)))
    parts: dict[StopState, tuple[str, ...]] = {
        StopState.SENT: ("the drives are asked",),
        StopState.CONFIRMED: (stopping.timed(counted(stopping.drives, "drive")),),
    }
    return Words(STOP_MARKS[stopping.state], f"STOP {stopping.state.value}", parts[stopping.state], tip)


def _robot(station: Station) -> Words:
    description, mark = station.robot.description, station.mark
    parts = [mark.word]
    if station.is_named and station.called != station.title:
        parts.append(f"calls itself {station.called}")
    parts.append(station.address)
    parts += [] if description is None else [description.role]
    parts += [f"you are {station.who}"] if station.who else []
    return Words(mark, station.title, tuple(parts), shorter=SHORTER.get(mark.word, mark.word))


def _drives(station: Station) -> Words:
    count = enabled_text(station.robot, live=station.is_live)  # whole: the rest makes it look better
    if not station.is_live and is_last_held(station):
        return Words(Mark("ring", "warn"), "Off when last seen", (no_data(station), count))
    if not station.is_live:
        return Words(Mark("ring", "old"), "Drives not known", (count,))
    mark = drives_mark(station.robot, enabled_mark(station.robot, station.stopping))
    few = SHORTER.get(mark.word, mark.word).capitalize()
    brief = (few, count.removesuffix(" enabled"))
    parts = (*_others(station), count, "CiA 402")
    return Words(mark, mark.word.capitalize(), parts, brief=brief)


def _others(station: Station) -> tuple[str, ...]:
    """Return what the other drives do where some are not known: `5 off`."""
    words = [station.robot.word(f"{joint}.state") for joint in station.robot.names("joint")]
    counts = {"enabled": words.count(ENABLED), "off": sum(map(is_off, words))}
    said = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    return (said,) if None in words and said else ()


def _status(station: Station) -> Words:
    if not station.is_live:
        return Words(Mark("ring", "old"), "Activity not known", ("no live data",))
    line = status(station)
    if line is not None and line.mark.word != OLD:
        parts = ("predicted", line.short) if line.detail.startswith("predicted") else (line.detail,)
        parts = ("doubtful", "predicted") if line.is_doubtful else parts
        parts = ("not checked", "predicted") if line.is_unchecked else parts
        tip = f"{line.text}\n{line.detail}"
        return Words(line.mark, line.text, tuple(filter(None, parts)), tip, line.least)
    gait, problem, seen = (
        station.processing.derived().gait,
        station.predictions.problem,
        by_steps(station),
    )
    why_not = f"not predicted: {problem}" if problem else "not predicted"
    parts = (seen.short or seen.detail, why_not if line is None else f"no prediction now, {line.detail}")
    if not gait.walking:
        return Words(seen.mark, seen.text, parts)
    cadence = "–" if gait.cadence_spm is None else f"{gait.cadence_spm:.0f}"
    return Words(seen.mark, seen.text, (f"{cadence} steps/min", *parts))


def _link(station: Station) -> Words:
    mark, main, parts = _linked(station)
    return Words(mark, main, parts, brief=tuple(main.split(" · ")))


def _linked(station: Station) -> tuple[Mark, str, tuple[str, ...]]:
    robot, link = station.robot, station.robot.link
    age = age_text(robot.age_s())
    old = f" · {age} old" if robot.age_s() is not None else ""
    if not station.is_linked:
        main = f"No link{old}" if link.links else "Never reached"
        return Mark("cross", "bad"), main, ("trying again", link.problem or link.state.value)
    lost = link.missed + link.dropped
    trip = "–" if link.round_trip_ns is None else f"{link.round_trip_ns / 1e6:.1f} ms"
    said = f"{lost} lost" if link.links > 1 else f"{lost} lost on the link"  # what a link lost is not counted
    again = (f"linked {link.links} times, {said}",) if link.links > 1 else (said,)
    parts = (*again, f"round trip {trip}")
    if robot.age_s() is None:
        return Mark("ring", "old"), "Linked, no data yet", parts
    if robot.is_stale():
        return Mark("triangle", "warn"), f"STALE · {age} old", parts
    mark = Mark("disc", "warn" if lost else "good") if robot.has_rate() else Mark("ring", "old")
    mark = Mark("triangle", "warn") if robot.is_slow() else mark
    return mark, f"{age} old · {robot.rate_text()}", parts


_WORDS: Final[dict[str, Callable[[Station], Words]]] = {
    "robot": _robot,
    "drives": _drives,
    "status": _status,
    "link": _link,
}
