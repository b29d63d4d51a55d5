"""Moments of a newcomer: the demo's start, its tour, what can be broken; a window without a robot."""

from typing import Final

from tests.gui.walks.robot import AGAIN_S, ENABLED, clear_fault
from tests.gui.walks.walk import Bench
from tests.support.waiting import until

STEPS: Final = ("at a glance", "STOP", "overview", "parameters", "afterwards")


def starting(bench: Bench) -> None:
    """What it is doing stands there from the first second until it walks."""
    hand = bench.hand
    hand.sees("GWRMS is starting")
    hand.keep("splash")
    hand.sees("steps/min", within_s=AGAIN_S)


def tour(bench: Bench) -> None:
    """Five steps, each about what it frames; it can be left, and begun again."""
    hand = bench.hand
    for place, step in enumerate(STEPS):
        hand.sees(f"{place + 1} of {len(STEPS)}, {step}")
        hand.keep(f"tour-{place + 1}")
        hand.click("Next" if place < len(STEPS) - 1 else "Done", exactly=True)
    hand.click("Tour", exactly=True)
    hand.click("Skip tour")
    hand.misses("1 of 5")


def break_something(bench: Bench) -> None:
    """A fault is chosen by its name, is seen where it is, and mended; then it is told to walk."""
    hand = bench.hand
    hand.click("Break something")
    hand.click("Drive of a joint")
    hand.click("overcurrent")
    hand.keep("break")
    hand.click("left knee", place=0, exactly=True)
    hand.sees("Tripped: left knee", within_s=AGAIN_S)
    hand.sees("0x2310")
    hand.keep("broken")
    clear_fault(hand, "fault: left knee")
    hand.sees("nothing was broken")
    hand.click("Start walking")
    until(lambda: any(map(hand.reads, ENABLED)), "walked again", AGAIN_S)
    hand.click("stop", exactly=True)
    hand.sees("A stop is held: reset it")
    hand.sees("STOPPED", "confirmed by all 6 drives")
    hand.keep("held")
    hand.click("Reset stop…")
    hand.click("Reset stop", exactly=True)
    hand.sees("stop reset")
    hand.click("Start walking")
    until(lambda: any(map(hand.reads, ENABLED)), "walked again", AGAIN_S)


def empty(bench: Bench) -> None:
    """Without a robot it offers three ways on; one that pairs, by a code, among them."""
    hand = bench.hand
    hand.reveal("Add a robot", "Robots")
    hand.click("Remove walker")
    hand.click("Remove", exactly=True)
    hand.sees("Welcome to GWRMS")
    hand.keep("empty")
    hand.click("Pair with a code…")
    hand.sees("sudo gwrms keys pair")
    hand.keep("pair")
    hand.click("Cancel")
    hand.click("Address of the first robot")
    hand.type(f"127.0.0.1:{bench.network.port}")
    hand.key("Return")
    until(lambda: any(map(hand.reads, ENABLED)), "showed the robot", AGAIN_S)
