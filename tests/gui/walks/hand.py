"""A hand and an eye at the window: xdotool moves, clicks and types; what is read is what stands there."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from tests.support.waiting import until

ANSWER_S: Final = 30.0
STILL_S: Final = 0.25
MOST_TURNS: Final = 12
MOST_CLICKS: Final = 3


@dataclass
class Hand:
    """On a display, with the window's answers; `kept` are the pictures that it took."""

    display: str
    asking: socket.socket
    pictures: Path
    kept: list[Path] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)  # what the rules for every picture found

    def ask(self, **question: Any) -> Any:
        self.asking.sendall(json.dumps(question).encode() + b"\n")
        said = b""
        while not said.endswith(b"\n"):
            piece = self.asking.recv(1 << 16)
            if not piece:
                raise ConnectionError("the window is gone")
            said += piece
        return json.loads(said)

    def where(self, name: str, place: int = 0, *, exactly: bool = False) -> tuple[int, int]:
        """The middle of what is called so, once it is there; a negative place counts from the last."""
        least = place + 1 if place >= 0 else -place
        found = until(
            lambda: at if len(at := self.ask(where=name, exactly=exactly)) >= least else None,
            lambda: f"{name!r} was never in sight; there was {self.ask(texts=1)}",
            ANSWER_S,
        )
        time.sleep(STILL_S)  # alarms come and go above: a hand waits until what it wants stands still
        again = self.ask(where=name, exactly=exactly)
        if len(again) < least or again[place] != found[place]:
            return self.where(name, place, exactly=exactly)
        return found[place][0], found[place][1]

    def can_see(self, name: str) -> bool:
        return bool(self.ask(where=name))

    def names(self) -> list[str]:
        """Return what everything is called that a hand could go to: what a menu offers first."""
        return [str(name) for name, *_ in self.ask(places=1)]

    def click(self, name: str, *, place: int = 0, times: int = 1, exactly: bool = False) -> None:
        """Click it where it stands."""
        x, y = self.where(name, place, exactly=exactly)
        self.xdotool("mousemove", str(x), str(y), "click", "--repeat", str(times), "--delay", "60", "1")

    def insist(self, name: str, so: Callable[[], object], *, place: int = 0, exactly: bool = False) -> None:
        """Click it, and again where that has missed: alarms come and go above while the mouse moves."""
        for _ in range(MOST_CLICKS):
            with contextlib.suppress(AssertionError):
                self.click(name, place=place, exactly=exactly)
                until(so, f"{name!r} was clicked", ANSWER_S / MOST_CLICKS)
                return
        until(so, f"what {name!r} leads to never came", ANSWER_S)

    def point(self, name: str) -> None:
        x, y = self.where(name)
        self.xdotool("mousemove", str(x), str(y))

    def reach(self, name: str) -> bool:
        """Turn the wheel over the tab until it is in sight, also once what has come has its place."""
        for _ in range(MOST_TURNS):
            if self.can_see(name):
                time.sleep(STILL_S)
                if self.can_see(name):
                    return True
            self.scroll()
        return False

    def scroll(self, turns: int = 1) -> None:
        """Turn the wheel over the tab."""
        x, y, *_ = max(self.ask(where="page"), key=lambda one: one[2] * one[3])
        self.xdotool("mousemove", str(x), str(y), "click", "--repeat", str(turns), "--delay", "60", "5")

    def reveal(self, name: str, panel: str) -> None:
        """Where a panel stands behind another, bring it to the front; where all are put away, show them."""
        if not self.can_see(name) and not self.can_see(panel):
            self.click("Panels")
        if not self.can_see(name):
            self.click(panel)

    def turn_to(self, section: str) -> None:
        """Show this section of the overview, where it is on a page of its own."""
        named = {one: one.lstrip("■▲✕ ").partition(":")[0] for one in self.names()}  # behind: what is wrong
        with_others = ("Joints and wearer", "Joints and plots", "Wearer and plots")
        wanted = (section, *(page for page in with_others if section.lower() in page.lower()))
        button = next((one for one, page in named.items() if page in wanted), None)
        if button is not None:
            self.click(button, exactly=True)

    def wheel(self, name: str, *, down: bool = True, place: int = 0) -> None:
        x, y = self.where(name, place)
        self.xdotool("mousemove", str(x), str(y), "click", "5" if down else "4")

    def key(self, *keys: str) -> None:
        """Press keys, in the window that has the hand's attention."""
        self.focus()
        self.xdotool("key", "--delay", "40", *keys)

    def type(self, text: str) -> None:
        self.xdotool("type", "--delay", "25", text)

    def focus(self) -> None:
        """What a screen's manager does by itself, which is none here."""
        if (window := self.ask(focus=1)) is not None:
            self.xdotool("windowfocus", str(window))

    def reads(self, *words: str) -> str | None:
        """A text that has all of these."""
        return next((text for text in self.ask(texts=1) if all(word in text for word in words)), None)

    def sees(self, *words: str, within_s: float = ANSWER_S) -> str:
        """Wait until a text has all of these."""
        return until(
            lambda: self.reads(*words),
            lambda: f"no text has {words}; there was {self.ask(texts=1)}",
            within_s,
        )

    def misses(self, *words: str, within_s: float = ANSWER_S) -> None:
        """Wait until no text has these."""
        until(lambda: self.reads(*words) is None, f"{words} never went", within_s)

    def keep(self, name: str) -> None:
        """A picture of the whole screen, and what the rules say of it."""
        path = self.pictures / f"{len(self.kept) + 1:02}-{name}.png"
        self.ask(picture=str(path))
        self.kept.append(path)
        self.wrong += [f"{name}: {one}" for one in self.ask(broken=1)]

    def xdotool(self, *words: str) -> None:
        environment = {**os.environ, "DISPLAY": self.display}
        subprocess.run(["xdotool", *words], env=environment, check=True, timeout=ANSWER_S)


@contextlib.contextmanager
def opened(display: str, folder: Path, pictures: Path, arguments: Sequence[str]) -> Iterator[Hand]:
    """`gwrms ARGUMENTS` on a display, with a home of its own in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures.mkdir(parents=True, exist_ok=True)
    answers = folder / "answers"
    environment = {
        **os.environ,
        "DISPLAY": display,
        "QT_QPA_PLATFORM": "xcb",
        **{f"XDG_{kind}_HOME": str(folder / kind.lower()) for kind in ("CONFIG", "DATA", "STATE", "CACHE")},
    }
    window = subprocess.Popen(
        [sys.executable, "-m", "tests.gui.walks.shown", str(answers), *arguments],
        env=environment,
        cwd=Path(__file__).parents[3],
    )
    try:
        with socket.socket(socket.AF_UNIX) as asking:
            until(lambda: _connects(asking, answers, window), "the window answers")
            asking.settimeout(ANSWER_S)
            yield Hand(display, asking, pictures)
    finally:
        window.terminate()
        try:
            window.wait(ANSWER_S)
        finally:
            window.kill()
            window.wait()


def _connects(asking: socket.socket, answers: Path, window: "subprocess.Popen[bytes]") -> bool:
    assert window.poll() is None, f"the window ended with {window.returncode}"
    try:
        asking.connect(str(answers))
    except OSError:
        return False
    return True
