"""The three walks: what integrator, bench tester and developer do and expect to see, moment by moment."""

import time
from collections.abc import Callable
from typing import Final

from tests.gui.walks.hand import Hand
from tests.gui.walks.walk import Bench
from tests.support.waiting import until

Moment = Callable[[Bench], None]
AGAIN_S: Final = 100.0  # until a simulated robot walks again, on a machine that does much else
ENABLED: Final = ("6 of 6 enabled", "6/6 enabled")
NEW_STEP: Final = "430"


def alive(bench: Bench) -> None:
    """The robot walks, and the window says so."""
    hand = bench.hand
    hand.sees("steps/min", within_s=AGAIN_S)
    hand.sees("enabled", "6")
    hand.keep("alive")


def one_glance(bench: Bench) -> None:
    """What people read first, and what a pointer over a plot adds."""
    hand = bench.hand
    if not hand.reach("Knee angle"):
        return
    hand.point("Knee angle")
    hand.sees("−", " s")
    hand.wheel("Knee angle")
    hand.keep("glance")
    hand.click("Knee angle", times=2)


def stopped(bench: Bench) -> None:
    """STOP by a click, its proof, and how to go on."""
    hand = bench.hand
    hand.click("STOP  walker", place=-1)
    hand.sees("STOPPED", "confirmed by all 6 drives")
    hand.sees("to go on")
    hand.misses("Abnormal")
    hand.keep("stopped")
    hand.click("Reset stop…")
    hand.sees("The STOP of walker is held")
    hand.keep("reset")
    hand.click("Reset stop", exactly=True)
    hand.sees("stop reset")
    none_enabled(hand)
    hand.keep("reset-done")
    walks_again(bench)


def link_cut(bench: Bench) -> None:
    """A STOP without a link is not confirmed, and when it is back, the robot is said to move still."""
    hand = bench.hand
    bench.cut()
    hand.sees("no link")
    hand.sees("Drives not known")
    hand.key("F12")
    hand.sees("STOP NOT CONFIRMED")
    hand.sees("use the hardware stop")
    none_enabled(hand)
    hand.misses("No alarms")
    hand.keep("no-link")
    bench.mend()
    hand.sees("still moving", within_s=AGAIN_S)
    hand.keep("still-moving")
    hand.key("ctrl+space")
    hand.sees("STOPPED", "confirmed by all 6 drives")
    hand.click("Reset stop…")
    hand.click("Reset stop", exactly=True)
    hand.sees("stop reset")
    walks_again(bench)


def two_robots(bench: Bench) -> None:
    """A second one is added by its address; each STOP says whose it is, and stops that one alone."""
    hand, robot = bench.hand, bench.second
    hand.reveal("Add a robot: HOST:PORT", "Robots")
    hand.click("Add a robot: HOST:PORT")
    hand.type(robot.address)
    hand.key("Return")
    until(lambda: robot.called("stream.start"), "followed the second robot")
    hand.keep("two-robots")
    hand.key("ctrl+2")
    hand.key("F12")
    until(lambda: robot.called("robot.stop"), "stopped the second robot")
    hand.keep("second-stopped")
    hand.key("ctrl+1")
    until(lambda: any(map(hand.reads, ENABLED)), "showed the first robot again")


def tuning(bench: Bench) -> None:
    """A value beyond the limit is marked; one within it is tried, seen without panels too, and taken back."""
    hand = bench.hand
    stage(hand, "step length", "4000")
    hand.sees("above the largest allowed")
    hand.keep("refused")
    stage(hand, "step length", NEW_STEP)
    hand.click("Review 1 …")
    hand.sees("Try it for")
    hand.keep("review")
    hand.click("Try it for")
    hand.sees("On trial")
    hand.key("F9")
    hand.sees("takes it back in")
    hand.keep("trial")
    hand.click("Take it back now")
    hand.misses("On trial")
    hand.key("F9")
    hand.reveal("Filter: name, 0x6072", "Parameters")
    hand.keep("taken-back")


def drive_fault(bench: Bench) -> None:
    """What, where, since when, what to check; its signal; and a reset that enables nothing."""
    hand = bench.hand
    bench.robot.break_("overcurrent", "right_hip")
    hand.sees("fault: right hip", "0x2310")
    hand.misses("No alarms")
    if not hand.can_see("Show the signal ± 5 s"):
        hand.click("fault: right hip")
    hand.keep("fault")
    hand.click("Show the signal ± 5 s")
    hand.sees("right_hip.")
    hand.keep("fault-signal")
    hand.click("Overview")
    if not hand.can_see("Clear fault…"):
        hand.click("fault: right hip")
    hand.click("Clear fault…")
    hand.keep("clear-fault")
    hand.click("Clear fault", exactly=True)
    hand.misses("fault: right hip")
    none_enabled(hand)
    walks_again(bench)


def insole_lost(bench: Bench) -> None:
    """A foot of which nothing is known carries no load, not none."""
    hand = bench.hand
    bench.robot.break_("sensor_unplugged", "left_insole")
    hand.sees("lost: left insole")
    hand.sees("left insole: lost")
    hand.misses("LEFT  0 N")
    hand.keep("insole")
    bench.robot.mend()
    hand.misses("lost: left insole", within_s=AGAIN_S)


def bus_in_trouble(bench: Bench) -> None:
    """A bus that is full, and a node that has left it."""
    hand = bench.hand
    hand.click("Bus")
    bench.robot.break_("bus_load", "bus")
    hand.sees("full", within_s=AGAIN_S)
    hand.keep("bus-full")
    bench.robot.mend()
    bench.robot.break_("bus_off", "left_knee")
    hand.sees("left knee", "heartbeat", within_s=AGAIN_S)
    hand.keep("bus-off")
    bench.robot.mend()
    hand.click("Overview")


def store_and_learning(bench: Bench) -> None:
    """What was recorded, in the store; what it learns from; and a store that has gone."""
    hand = bench.hand
    hand.click("Cloud")
    hand.click("Upload now")
    hand.keep("cloud")
    hand.click("Models")
    hand.click("Train a model")
    hand.keep("models")


def replay(bench: Bench) -> None:
    """A recording is played in the views of a robot, and says so; STOP is that of the live one."""
    hand = bench.hand
    hand.click("Recordings")
    today = time.strftime("%Y-%m-%d")
    hand.sees(today, within_s=AGAIN_S)
    hand.click(today)
    hand.click("Play")
    hand.sees("PLAYBACK, not live", within_s=AGAIN_S)
    hand.keep("replay")
    hand.click("← All")


def signals(bench: Bench) -> None:
    """Two channels beside each other, with cursors."""
    hand = bench.hand
    hand.click("Signals")
    hand.click("Filter channels")
    hand.type("knee.position")
    hand.click("Cursors")
    hand.keep("signals")
    hand.click("Overview")


def resources(bench: Bench) -> None:
    """Who uses the computer, sorted by a click."""
    hand = bench.hand
    hand.click("Resources")
    hand.sees("processes")
    hand.keep("resources")
    hand.click("Audit")
    hand.sees("by")
    hand.keep("audit")
    hand.click("Overview")


def keys(bench: Bench) -> None:
    """Every key on one sheet."""
    hand = bench.hand
    hand.key("question")
    hand.sees("Ctrl+F")
    hand.keep("keys")
    hand.key("question")
    hand.misses("What the manual says of this")


def walks_again(bench: Bench) -> None:
    """The simulated controller enables the drives, which nothing in this window does."""
    bench.robot.mend()

    def walks() -> bool:
        bench.robot.walk()
        return any(map(bench.hand.reads, ENABLED))

    until(walks, "walked again", AGAIN_S)


def none_enabled(hand: Hand) -> None:
    """Nothing says that all drives are under power."""
    for words in ENABLED:
        hand.misses(words)


def stage(hand: Hand, words: str, value: str) -> None:
    """As a newcomer edits: find it, click it, type."""
    hand.key("ctrl+f")
    hand.key("ctrl+a")
    hand.type(words)
    hand.click(words, place=-1)
    hand.key("F2")
    hand.type(value)
    hand.xdotool("key", "Return")


WALKS: Final[dict[str, tuple[Moment, ...]]] = {
    "integrator": (alive, keys, one_glance, stopped, link_cut, two_robots),
    "bench-tester": (alive, tuning, drive_fault, insole_lost, bus_in_trouble),
    "developer": (alive, signals, resources, replay, store_and_learning),
}
SHORT: Final[tuple[Moment, ...]] = (alive, stopped)
