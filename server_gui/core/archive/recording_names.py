"""Names that tell two recordings apart: by their time, and by robot, day or session where that differs."""

from datetime import UTC, datetime

from server_gui.core.cloud.tape import Tape

Names = tuple[str, str]


def short_names(first: Tape, second: Tape) -> Names:
    """Return what has room in a legend: `20:37:44`, with what else tells them apart."""
    both = first, second
    clocks = [_clock(one) for one in both]
    parts = [[f"{clock:%H:%M:%S}"] for clock in clocks]
    if clocks[0].date() != clocks[1].date():
        _before(parts, [f"{clock:%Y-%m-%d}" for clock in clocks])
    if first.session.robot != second.session.robot:
        _before(parts, [one.session.robot for one in both])
    if parts[0] == parts[1]:
        _before(parts, [_end(one) for one in both])
    here, beside = (" ".join(one) for one in parts)
    return here, beside


def long_names(first: Tape, second: Tape | None) -> Names:
    """Return robots, days and times, and what was noted at their starts; empty of none."""
    here, beside = (_long(one) for one in (first, second))
    if second is not None and here == beside:
        here, beside = f"{here}, {_end(first)}", f"{beside}, {_end(second)}"
    return here, beside


def _long(tape: Tape | None) -> str:
    if tape is None:
        return ""
    session = tape.session
    return ", ".join(filter(None, (session.robot, f"{_clock(tape):%Y-%m-%d %H:%M:%S}", session.notes)))


def _end(tape: Tape) -> str:
    """Return the end of the session's name, which is its own."""
    return tape.session.session.rpartition("-")[2]


def _before(parts: list[list[str]], texts: list[str]) -> None:
    for one, text in zip(parts, texts, strict=True):
        one.insert(0, text)


def _clock(tape: Tape) -> datetime:
    """Return its beginning by the local clock."""
    return datetime.fromtimestamp(tape.first_ns / 1e9, UTC).astimezone()
