"""Turns what a robot's state does into news: links, components, drive states, error codes."""

from typing import Final, Protocol

from drivers.error_codes import code_in, error_text
from gateway.client import ConnectionState
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import FollowedComponent, Robot


class Tell(Protocol):
    """Function that reports news, of a component if it is `about` one."""

    def __call__(self, kind: NewsKind, text: str, about: str = "") -> None:
        """Tell it."""


FEW: Final = 2  # drives that are named before their change
LINK_WORDS: Final = {
    ConnectionState.CONNECTED: "connected",
    ConnectionState.WAITING: "no link",
    ConnectionState.CLOSED: "closed",
}
KINDS: Final = {
    "ok": NewsKind.STATE,
    "fault": NewsKind.FAULT,
    "lost": NewsKind.LOST,
    "stale": NewsKind.STALE,
}


class RobotNews:
    """Compares a robot with how it was at the last look; says each change once."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._link: ConnectionState | None = None
        self._parts: dict[str, str] = {}
        self._drives: dict[str, str] = {}
        self._errors: dict[str, float] = {}
        self._told: dict[str, int] = {}  # code of the fault that is told already, by component
        self._failure: object = None

    def look(self, robot: Robot) -> None:
        """Report changes since the last call."""
        self._look_at_link(robot)
        self._look_at_parts(robot)
        if not robot.is_stale():
            self._look_at_drives(robot)
        if robot.last_failure is not self._failure:
            self._failure = robot.last_failure
            if robot.last_failure is not None:
                self._tell(NewsKind.WARNING, f"{robot.last_failure.what}: {robot.last_failure.reason}")

    def _look_at_link(self, robot: Robot) -> None:
        state = robot.link.state
        if state is self._link or state not in LINK_WORDS:
            return
        self._link = state
        why = f": {robot.link.problem}" if robot.link.problem else ""
        kind = NewsKind.STATE if state is ConnectionState.CONNECTED else NewsKind.LINK
        self._tell(kind, f"{LINK_WORDS[state]}{why}")

    def _look_at_parts(self, robot: Robot) -> None:
        for part in robot.parts.values():
            if part.comes_up:
                continue
            before = self._parts.get(part.name, "ok")
            if part.state not in (before, "fault"):
                self._told.pop(part.name, None)
            if part.state != before and not self._is_told(part):
                why = f": {part.problem}" if part.problem else ""
                kind = KINDS.get(part.state, NewsKind.WARNING)
                self._tell(kind, f"{_spoken(part.name)} {part.state}{why}", part.name)
            self._parts[part.name] = part.state

    def _look_at_drives(self, robot: Robot) -> None:
        changed: dict[tuple[str, str], list[str]] = {}
        for joint in robot.names("joint"):
            word = robot.word(f"{joint}.state")
            before = self._drives.get(joint)
            if word is None or word == before:
                continue
            self._drives[joint] = word
            if "fault" in (before or "") and "fault" not in word:
                self._told.pop(joint, None)  # also where a drive keeps its last code
            if before is not None:
                changed.setdefault((before, word), []).append(joint)
        every, errors = len(robot.names("joint")), self._new_errors(robot)
        for (before, word), joints in changed.items():
            kind = NewsKind.FAULT if "fault" in word else NewsKind.STATE
            names = ", ".join(map(_spoken, joints))
            change = f"{before} → {word}"
            if len(joints) == every > FEW:
                self._tell(kind, f"all {every} drives: {change}")
            elif (
                len(joints) == 1 and kind is NewsKind.FAULT and joints[0] in errors
            ):  # one cause is one event
                self._tell(kind, f"{names}: {errors.pop(joints[0])} ({change})", joints[0])
            elif kind is NewsKind.FAULT and self._told.keys() >= {*joints} and not errors.keys() & {*joints}:
                continue  # the robot has said so, with its code
            elif len(joints) > FEW:  # the change first: names have no room where there is little
                self._tell(kind, f"{len(joints)} of {every} drives: {change} ({names})")
            else:
                self._tell(kind, f"{names}: {change}")
        for joint, text in errors.items():
            self._tell(NewsKind.FAULT, f"{_spoken(joint)}: {text}", joint)

    def _new_errors(self, robot: Robot) -> dict[str, str]:
        """Return in words the error of each joint that has another than before."""
        found = {}
        for joint in robot.names("joint"):
            code = robot.values.get(f"{joint}.error_code")
            if code is None or code == self._errors.get(joint, 0.0):
                continue
            self._errors[joint] = code
            if not code:
                self._told.pop(joint, None)
            if code and self._told.get(joint) != code:
                found[joint] = error_text(int(code))
                self._told[joint] = int(code)
        return found

    def _is_told(self, part: FollowedComponent) -> bool:
        """Return whether this fault is an event already, by its code; note that it is one now."""
        code = code_in(part.problem or "") if part.state == "fault" else None
        if code is None:
            return False
        is_told = self._told.get(part.name) == code
        self._told[part.name] = code
        return is_told


def _spoken(name: str) -> str:
    return name.replace("_", " ")
