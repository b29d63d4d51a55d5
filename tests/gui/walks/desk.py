"""Moments at the desk: values tried, recordings made and played, models trained, a store that goes away."""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Final

from tests.gui.walks.hand import Hand
from tests.gui.walks.robot import AGAIN_S, play_newest
from tests.gui.walks.walk import Bench
from tests.support.waiting import until
from tests.unit.training.walkers import day, put

NEW_STEP: Final = "430"
SHORTEST_S: Final = "5"
WEARERS: Final = 4
JUDGE: Final = "s3"
TAKE_BACK: Final = ("Take back", "Take it back now")  # on the overview, and where that is not in sight
EATER: Final = "gait_planner"


def tuning(bench: Bench) -> None:
    """A value beyond the limit is marked; one within it is tried, seen without panels too, and taken back."""
    hand = bench.hand
    stage(hand, "step length", "4000")
    hand.sees("above the largest allowed")
    hand.keep("refused")
    stage(hand, "step length", NEW_STEP)
    hand.click("Review 1 …")
    until(lambda: hand.can_see("Try it for"), "could be tried")
    hand.keep("review")
    hand.insist("Try it for", lambda: hand.reads("On trial"))
    hand.key("F9")
    hand.sees("taken back in")
    ends = until(lambda: next(filter(hand.can_see, TAKE_BACK), None), "could be taken back")
    hand.keep("trial")
    hand.click(ends)
    hand.misses("On trial")
    hand.key("F9")
    hand.reveal("Filter: name, 0x6072", "Parameters")
    hand.keep("taken-back")


def trial_runs_out(bench: Bench) -> None:
    """Nobody keeps it: the robot takes it back by itself, and that stands where it is looked for."""
    hand = bench.hand
    stage(hand, "step length", NEW_STEP)
    hand.click("Review 1 …")
    hand.click("Length of the trial")
    hand.key("ctrl+a")
    hand.type(SHORTEST_S)
    hand.insist("Try it for", lambda: hand.reads("On trial"))
    hand.misses("On trial")
    hand.sees("taken it back")
    hand.keep("run-out")


def edits(bench: Bench) -> None:
    """What was tried is listed, with what it did to the walk, or that this is not known yet."""
    hand = bench.hand
    hand.click("Edits")
    hand.sees("step length", "gait cycle", within_s=AGAIN_S)
    hand.keep("edits")
    hand.click("Overview")


def pages(bench: Bench) -> None:
    """Each tab that only shows something, with what is done there first."""
    hand = bench.hand
    for title, does, words in PAGES:
        hand.insist(title, partial(hand.reads, words))
        does(hand)
        hand.keep(title.lower())
    hand.click("Overview")


def two_channels(hand: Hand) -> None:
    """Beside each other, with cursors."""
    hand.click("Filter channels")
    hand.type("knee.position")
    hand.click("Cursors")
    hand.sees("Δt")


def a_locked_object(hand: Hand) -> None:
    """Found by its address, with what it holds, and why it may not be written."""
    hand.click("Search of the objects")
    hand.type("0x606*")
    hand.click("0x6060:0")
    hand.sees("cyclic synchronous")


def a_core_is_eaten(bench: Bench) -> None:
    """Whoever does that stands first in the table."""
    hand, program = bench.hand, bench.folder / EATER
    shutil.copy(sys.executable, program)
    with subprocess.Popen([str(program), "-S", "-c", "while True: pass"]) as process:
        try:
            hand.click("Resources")
            hand.sees(EATER, within_s=AGAIN_S)
            hand.click("Filter processes by name or command")
            hand.type(EATER)
            hand.keep("eaten")
        finally:
            process.kill()
    hand.click("Overview")


def recording(bench: Bench) -> None:
    """It is stopped and begun by hand, with a name; and a disk that refuses is told at once."""
    hand = bench.hand
    hand.key("ctrl+r")
    hand.sees("nothing else that they send is kept")
    hand.keep("stop-recording")
    hand.click("Stop recording", exactly=True, place=-1)
    hand.sees("Not recording")
    hand.keep("not-recording")
    hand.key("ctrl+r")
    hand.click("Name of the recording")
    hand.type("new insoles")
    hand.click("Start", exactly=True)
    hand.misses("Not recording")
    bench.spool.rename(bench.folder / "away")
    hand.sees("NOT RECORDING", within_s=AGAIN_S)
    hand.keep("recording-refused")
    (bench.folder / "away").rename(bench.spool)
    hand.misses("NOT RECORDING", within_s=AGAIN_S)


def replay(bench: Bench) -> None:
    """A recording is played in the views of a robot, says so, and is labelled; STOP is the live robot's."""
    hand = bench.hand
    play_newest(hand)
    hand.sees("steps/min", within_s=AGAIN_S)
    hand.keep("replay")
    hand.reveal("The span is the whole recording", "Labels")
    hand.click("The span is the whole recording")
    hand.click("Label span")
    hand.sees("walk", "Ada", "person")
    hand.keep("labelled")
    hand.click("← All")


def side_by_side(bench: Bench) -> None:
    """Two recordings in the same plots: marked in the list, aligned by their beginnings or a heel strike."""
    hand = bench.hand
    hand.click("Recordings")
    today = time.strftime("%Y-%m-%d")
    until(lambda: len(hand.ask(where=today)) > 1, "listed two recordings", AGAIN_S)
    hand.click(today)
    x, y = hand.where(today, 1)
    hand.xdotool("mousemove", str(x), str(y), "keydown", "ctrl", "click", "1", "keyup", "ctrl")
    hand.insist("Side by side", lambda: hand.reads("aligned by"), exactly=True)
    hand.sees("aligned by", within_s=AGAIN_S)
    hand.sees("difference", "°", within_s=AGAIN_S)  # both have come into the plots
    hand.misses("reading …", within_s=AGAIN_S)
    hand.keep("side-by-side")
    hand.click("Close the second recording")
    hand.misses("aligned by")
    hand.click("← All")


def uploaded(bench: Bench) -> None:
    """What was recorded until now is in the store."""
    hand = bench.hand
    hand.click("Cloud")
    hand.click("Look again")
    hand.sees("batches uploaded", within_s=AGAIN_S)
    hand.sees("telemetry", within_s=AGAIN_S)
    hand.keep("cloud")
    hand.click("Overview")


def learning(bench: Bench) -> None:
    """From labelled sessions a model is trained and compared; what would serve, and who signs it, is said."""
    hand = bench.hand
    days = [day(f"s{number}", number, each_s=5.0) for number in range(WEARERS)]
    put(bench.store.as_uri(), bench.folder / "walks", days)
    hand.key("alt+m")
    hand.insist("Train a model", lambda: hand.reads("What it predicts"))
    hand.reach("Start training")
    hand.reach(JUDGE)
    hand.click(JUDGE, exactly=True)  # by name: else the recording of this bench may be among the judges
    assert hand.reach(f"Judged by {JUDGE};")
    hand.keep("train")
    hand.click("Start training")
    hand.sees("Not compared with", within_s=AGAIN_S)
    hand.sees("Train a model")  # the form is gone, and its result in sight
    hand.keep("trained")
    hand.insist("Promote…", lambda: hand.reads("Serves now"))
    hand.keep("promote")
    hand.reach("Change nothing")
    hand.click("Change nothing")
    hand.reach("Probabilities are off by")
    hand.keep("compared")


def store_gone(bench: Bench) -> None:
    """It is said on every page that needs it, and what is recorded waits in the spool."""
    hand, away = bench.hand, bench.folder / "store-away"
    bench.store.rename(away)
    bench.store.write_text("no folder")
    hand.click("Cloud")
    hand.click("Look again")
    hand.sees("Not reached", within_s=AGAIN_S)
    hand.keep("store-gone")
    for title, key, words in (
        ("models", "alt+m", "Train a model"),
        ("recordings", "alt+c", "Mark now"),
    ):
        hand.key(key)
        hand.sees(words)
        hand.sees("there is no store at", within_s=AGAIN_S)
        hand.keep(f"store-gone-{title}")
    bench.store.unlink()
    away.rename(bench.store)
    hand.click("Overview")


def keys(bench: Bench) -> None:
    """Every key on one sheet."""
    hand = bench.hand
    hand.key("question")
    hand.sees("Ctrl+F")
    hand.keep("keys")
    hand.key("question")
    hand.misses("The manual on this page")


def stage(hand: Hand, words: str, value: str) -> None:
    """As a newcomer edits: find it, click it, type."""
    hand.key("ctrl+f")
    hand.key("ctrl+a")
    hand.type(words)
    hand.click(words, place=-1)
    hand.key("F2")
    hand.type(value)
    hand.xdotool("key", "Return")


PAGES: Final[tuple[tuple[str, Callable[[Hand], None], str], ...]] = (
    ("Signals", two_channels, "Box zoom"),
    ("Resources", lambda _: None, "processes"),
    ("Bus", lambda _: None, "main"),
    ("Objects", a_locked_object, "Read all"),
    ("Audit", lambda _: None, "journal"),
    ("Edits", lambda _: None, "No edit is known yet"),
)
