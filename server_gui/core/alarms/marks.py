"""States for the eye: a shape, a colour's name and a word, never one alone. The unknown is never good."""

from dataclasses import dataclass
from typing import Final

from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot


@dataclass(frozen=True, slots=True)
class Mark:
    """`shape` is one of the keys of `GLYPHS`, `colour` a name in the palette."""

    shape: str
    colour: str
    word: str = ""


ENABLED: Final = "operation enabled"
GLYPHS: Final = {
    "disc": "●",
    "ring": "○",
    "half": "◐",
    "cross": "✕",
    "square": "■",
    "box": "□",
    "triangle": "▲",
    "diamond": "◆",
}

STATES: Final = {
    "ok": Mark("disc", "good", "ok"),
    "stale": Mark("triangle", "warn", "stale"),
    "lost": Mark("cross", "bad", "lost"),
    "fault": Mark("square", "bad", "fault"),
    "operation enabled": Mark("disc", "good", "operation enabled"),
    "switched on": Mark("half", "warn", "switched on"),
    "ready to switch on": Mark("half", "warn", "ready to switch on"),
    "switch on disabled": Mark("ring", "dim", "switch on disabled"),
    "not ready to switch on": Mark("ring", "dim", "not ready"),
    "quick stop active": Mark("triangle", "warn", "quick stop active"),
    "fault reaction active": Mark("square", "bad", "fault reaction"),
}

STILL_ENABLED: Final = Mark("square", "bad", ENABLED)  # after a STOP that is not confirmed, or again since
ASKED: Final = Mark("half", "warn", ENABLED)  # while a stop is sent or held, by rows of before

NEWS: Final = {
    NewsKind.LINK: Mark("cross", "bad", "LINK"),
    NewsKind.STATE: Mark("diamond", "accent", "STATE"),
    NewsKind.WARNING: Mark("triangle", "warn", "WARN"),
    NewsKind.FAULT: Mark("square", "bad", "FAULT"),
    NewsKind.LOST: Mark("cross", "bad", "LOST"),
    NewsKind.STALE: Mark("triangle", "warn", "STALE"),
    NewsKind.PARAMETER: Mark("disc", "good", "PARAM"),
    NewsKind.STOP: Mark("triangle", "warn", "STOP"),
    NewsKind.NOT_STOPPED: Mark("square", "bad", "STOP"),
    NewsKind.CONTROL: Mark("diamond", "accent", "CONTROL"),
}

NOT_KNOWN: Final = Mark("ring", "old", "not known")


def state_mark(word: str | None) -> Mark:
    """Return the mark of a component's or drive's state."""
    return NOT_KNOWN if word is None else STATES.get(word.lower(), Mark("triangle", "warn", word))


def drives_mark(robot: Robot, enabled: Mark) -> Mark:
    """Return all drives in one: enabled only where every one is, the worst otherwise.

    `enabled` is the mark of one that is enabled: no good state while a stop is sent or held.
    """
    joints = robot.names("joint")
    if not joints:
        return Mark("ring", "old", "no drives")
    if robot.is_stale():
        return Mark("ring", "old", "drives not known now")
    words = [robot.word(f"{joint}.state") for joint in joints]
    count = words.count(ENABLED)
    some = Mark("half", "bad" if enabled.colour == "bad" else "warn", f"{count} of {len(joints)} enabled")
    is_bad = count > 0 and some.colour == "bad"  # then nothing that is less so hides it
    for bad in ("fault", "fault reaction active", *(() if is_bad else ("quick stop active",))):
        if bad in words:
            return Mark(STATES[bad].shape, STATES[bad].colour, f"{words.count(bad)} in {bad}")
    if None in words and not is_bad:
        return Mark("ring", "old", f"{words.count(None)} of {len(joints)} drives not known")
    if count == len(joints):
        return enabled
    if count:
        return some
    return state_mark(words[0]) if len(set(words)) == 1 else Mark("half", "warn", "drives differ")


def enabled_text(robot: Robot, *, live: bool) -> str:
    """Return how many drives are enabled, as far as that is known."""
    joints = robot.names("joint")
    known = [word for joint in joints if live and (word := robot.word(f"{joint}.state")) is not None]
    enabled = known.count(ENABLED) if known or (live and not joints) else "–"
    unknown = f", {len(joints) - len(known)} not known" if known and len(known) < len(joints) else ""
    every = len(joints) if joints or live else "–"  # nobody knows how many it has
    return f"{enabled} of {every} enabled{unknown}"


def age_text(age_s: float | None) -> str:
    """Return an age for people."""
    if age_s is None:
        return "no data yet"
    if age_s < 1.0:
        return f"{age_s * 1000:.0f} ms"
    if age_s < 120.0:
        return f"{age_s:.1f} s"
    return f"{age_s / 60:.0f} min" if age_s < 7200 else f"{age_s / 3600:.1f} h"
