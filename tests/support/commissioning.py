"""A command that commissions, played by a test: it says what the test says, and notes what it is told."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from server_gui.core.commissioning.commissioning import GUARD_S, Commissioning, Exit
from server_gui.core.commissioning.request import CommissioningRequest

WISH = CommissioningRequest("/home/ada/exo-01.toml", "can0", who="Ada")
JOINT = ("which drive", "its EDS", "heartbeat", "PDO", "what counts mean", "limits", "ratings", "homing")
FIRST = ("its name", "what is on the bus", "who leads the bus", "who commands the drives", "its joints")
LAST = ("feet and trunk", "the file")
JOINTS = ("left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle")
FILE = '# exo-01, commissioned by Ada.\n\n[robot]\nname = "exo-01"\n\n[joint.left_hip]\nnode_id = 11\n'


class FakeTalker:
    """One command."""

    def __init__(self, arguments: Sequence[str], computer: str) -> None:
        self.arguments = arguments
        self.computer = computer
        self.told: list[str] = []
        self.asked_to_end = False
        self.killed = False
        self._lines: list[str] = []
        self._exit: Exit | None = None

    @property
    def ended(self) -> Exit | None:
        return None if self._lines else self._exit

    def heard(self) -> list[str]:
        lines, self._lines = self._lines, []
        return lines

    def send(self, line: str) -> None:
        self.told.append(line)

    def end(self) -> None:
        self.asked_to_end = True

    def kill(self) -> None:
        self.killed = True

    def join(self, within_s: float) -> bool:
        return self._exit is not None

    # --- what the test makes of it

    @property
    def answers(self) -> list[str]:
        return [json.loads(line).get("answer") for line in self.told]

    def says(self, *lines: Mapping[str, Any] | str) -> None:
        self._lines += [line if isinstance(line, str) else json.dumps(line) for line in lines]

    def ends(self, status: int | None, last_words: str = "") -> None:
        self._exit = Exit(status, last_words)


class Played:
    """Commissioning whose commands are played, with a clock that the test sets."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.talkers: list[FakeTalker] = []
        self.model = Commissioning(self._talk, lambda: self.now_s)

    def _talk(self, arguments: Sequence[str], computer: str) -> FakeTalker:
        self.talkers.append(FakeTalker(arguments, computer))
        return self.talkers[-1]

    @property
    def talker(self) -> FakeTalker:
        """The newest one."""
        return self.talkers[-1]

    def start(self, wish: CommissioningRequest = WISH) -> None:
        self.model.start(wish)

    def hear(self, *lines: Mapping[str, Any] | str) -> None:
        """Something comes, and is looked at; then some time passes."""
        self.talker.says(*lines)
        self.model.look()
        self.now_s += 2 * GUARD_S

    def end(self, status: int | None, last_words: str = "") -> None:
        self.talker.ends(status, last_words)
        self.model.look()


def asks(text: str, number: int = 1, **more: Any) -> dict[str, Any]:
    return {"ask": text, "number": number, **more}


def lives(
    number: int = 1, *readings: tuple[str, float | str | None, str], problem: str = ""
) -> dict[str, Any]:
    found = [{"name": name, "value": value, "unit": unit} for name, value, unit in readings]
    return {"live": found, "number": number, "problem": problem}


def steps(now: tuple[str, str] = ("left_knee", "what counts mean")) -> dict[str, Any]:
    """All before `now` are done, but one that was passed."""
    every = [("robot", one) for one in FIRST]
    every += [(joint, one) for joint in JOINTS for one in JOINT]
    every += [("sensors and file", one) for one in LAST]
    at = every.index(now)
    states = ["done" if place < at else "now" if place == at else "next" for place in range(len(every))]
    states[len(FIRST) + 3] = "passed"
    return {
        "steps": [
            {"part": part, "title": title, "state": state}
            for (part, title), state in zip(every, states, strict=True)
        ]
    }


def written(*findings: tuple[str, str], usable: bool = True, **more: Any) -> dict[str, Any]:
    told = {"file": WISH.file, "text": FILE, "findings": findings, "usable": usable, **more}
    return {"written": told}


def stopped(*, confirmed: bool = True) -> dict[str, Any]:
    words = "STOP is confirmed by node 7" if confirmed else "NOT CONFIRMED: node 7 is unreachable"
    outcome = "confirmed" if confirmed else "unreachable"
    told: dict[str, Any] = {"confirmed": confirmed, "words": words, "drives": {"node 7": outcome}}
    if confirmed:
        told |= {"states": {"node 7": "switch on disabled"}, "after_ms": {"node 7": 34.2}}
    return {"stopped": told}


KNEE = asks(
    "Hold the left knee still at one known angle, such as straight, 0°, and type the angle in degrees "
    "(flexion positive).",
    14,
    unit="°",
    bounds=(-180, 360),
    refused="'12,5' is no number of -180 to 360 °",
)
BEND = asks(
    "Bend the left knee by hand by a good part of its way, and keep it there.",
    13,
    choices=["moved", "skip"],
    default="moved",
)
MOVES = lives(
    13,
    *(
        reading
        for place, node in enumerate((2, 3, 7, 11, 23, 40))
        for reading in (
            (f"node {node}", 61_234 if place == 2 else place, "counts moved"),
            (f"node {node}", "no power", ""),
        )
    ),
)


def not_started(_played: Played) -> None:
    pass


def starting(played: Played) -> None:
    played.start()


def working(played: Played) -> None:
    played.start()
    played.hear(steps(("robot", "what is on the bus")), {"say": "Listening, then asking all 127 node ids …"})
    played.now_s += 12.0


def silent(played: Played) -> None:
    working(played)
    played.now_s += 60.0


def typing(played: Played) -> None:
    played.start()
    played.hear(
        steps(), {"say": "left knee is node 7 (moved by hand: it counted 61234, the others 5 or less)."}
    )
    played.hear({"say": KNEE["refused"]}, KNEE)
    played.hear(lives(14, ("node 7", -30_500, "counts"), ("node 7", "no power", "")))


def hand(played: Played) -> None:
    played.start()
    played.hear(steps(("left_knee", "which drive")), BEND, MOVES)


def powered(played: Played) -> None:
    played.start()
    text = (
        "node 7, node 11 may be under power. Switch the drives off (controller off, or STO) before you take "
        "hold of a joint; this command never switches anything on or off. Then press Enter."
    )
    played.hear(steps(("left_knee", "which drive")), asks(text, 9, press=True))


def moving(played: Played) -> None:
    played.start()
    played.hear(steps(("left_knee", "homing")), {"say": "Listening whether somebody else is on the bus …"})
    played.hear({"moving": "The left knee is under power. STOP: Enter.  searching for home (+3.5°)"})


def died_moving(played: Played) -> None:
    moving(played)
    played.end(-9)


def bus_gone(played: Played) -> None:
    hand(played)
    played.hear(lives(13, problem="node 7 on main: 0x6064:00: no answer within 0.5 s"))


def stopping(played: Played) -> None:
    hand(played)
    played.model.stop()
    played.model.look()


def stop_confirmed(played: Played) -> None:
    stopping(played)
    played.hear(stopped())
    played.end(0)


def stop_not_confirmed(played: Played) -> None:
    stopping(played)
    played.hear(stopped(confirmed=False))
    played.end(1)


def ending(played: Played) -> None:
    hand(played)
    played.model.interrupt()
    played.model.look()


def left(played: Played) -> None:
    ending(played)
    played.end(143)


def proposed(played: Played) -> None:
    played.start()
    played.hear(steps(("sensors and file", "the file")), {"say": FILE, "file": WISH.file})
    played.hear(asks(f"Write this to {WISH.file}?", 60, choices=["y", "n"], default="n"))


def was_written(played: Played) -> None:
    proposed(played)
    played.model.answer("y")
    played.hear(written(), {"say": f"{WISH.file} is written."})
    played.end(0)


def not_usable(played: Played) -> None:
    proposed(played)
    played.model.answer("y")
    played.hear(written(("error", "[joint.left_hip]: eds: drive.eds is not there"), usable=False))
    played.end(1)


def failed(played: Played) -> None:
    played.start()
    played.hear({"error": {"kind": "Unavailable", "message": "can0: there is no such interface"}})
    played.end(1)


def died(played: Played) -> None:
    hand(played)
    played.end(-9)


EVERY: tuple[Callable[[Played], None], ...] = (
    *(
        not_started,
        starting,
        working,
        silent,
        typing,
        hand,
        powered,
        moving,
        died_moving,
        bus_gone,
        stopping,
        stop_confirmed,
    ),
    *(stop_not_confirmed, ending, left, proposed, was_written, not_usable, failed, died),
)
