"""Moments at a robot: it walks, is stopped, loses its link, breaks; and a second one beside it."""

import re
import time
from typing import Final

from tests.gui.walks.hand import Hand
from tests.gui.walks.walk import Bench
from tests.support.waiting import until

AGAIN_S: Final = 100.0  # until a simulated robot walks again, on a machine that does much else
FAULT_EVENT: Final = re.compile(r"\d+:\d\d\.\d  fault: .*right hip")
ENABLED: Final = ("6 of 6 enabled", "6/6 enabled")
STOPPED: Final = ("0 of 6 enabled", "0/6 enabled")


def alive(bench: Bench) -> None:
    """The robot walks, and the window says so."""
    hand = bench.hand
    hand.sees("steps/min", within_s=AGAIN_S)
    hand.sees("enabled", "6")
    hand.keep("alive")


def one_glance(bench: Bench) -> None:
    """What people read first, and what a pointer over a plot adds."""
    hand = bench.hand
    hand.turn_to("Plots")
    if not hand.reach("Knee angle"):
        return
    hand.scroll(3)  # not only its title
    hand.point("Knee angle")
    hand.sees("−", " s")
    hand.wheel("Knee angle")
    hand.keep("glance")
    hand.click("Knee angle", times=2)


def stopped(bench: Bench) -> None:
    """STOP by a click, its proof, and how to go on."""
    hand = bench.hand
    hand.click("stop", exactly=True)
    hand.sees("STOPPED", "confirmed by all 6 drives")
    hand.sees("to go on")
    hand.misses("Abnormal")
    hand.keep("stopped")
    hand.click("Reset stop…")
    hand.sees("Reset the stop of walker?")
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
    hand.sees("STILL MOVING", within_s=AGAIN_S)
    hand.keep("still-moving")
    hand.key("ctrl+space")
    hand.sees("STOPPED", "confirmed by all 6 drives")
    hand.click("Reset stop…")
    hand.click("Reset stop", exactly=True)
    hand.sees("stop reset")
    walks_again(bench)


def two_robots(bench: Bench) -> None:
    """A second one is added by its address; each STOP says whose it is, and stops that one alone."""
    hand = bench.hand
    where = bench.another()
    hand.reveal("Add a robot", "Robots")
    hand.click("Add a robot")
    hand.type(where)
    hand.key("Return")
    hand.key("ctrl+2")
    hand.sees("STOP  ", "exo")
    until(lambda: any(map(hand.reads, ENABLED)), "showed the second robot", AGAIN_S)
    hand.keep("two-robots")
    hand.key("F12")
    hand.sees("STOPPED", "confirmed by all 6 drives")
    until(lambda: any(map(hand.reads, STOPPED)), "showed that the second is off", AGAIN_S)
    until(lambda: any(map(hand.reads, ENABLED)), "showed the first one's card, as it walks", AGAIN_S)
    hand.keep("second-stopped")
    hand.key("ctrl+1")
    until(lambda: any(map(hand.reads, ENABLED)), "showed that the first still walks", AGAIN_S)
    hand.keep("first-walks-on")
    hand.reveal("STOP  ALL", "Robots")
    hand.click("STOP  ALL")
    none_enabled(hand)
    hand.keep("all-stopped")


def drive_fault(bench: Bench) -> None:
    """What, where, since when, what to check; its signal; and a reset that enables nothing."""
    hand = bench.hand
    bench.robot.break_("overcurrent", "right_hip")
    hand.sees("fault: right hip", "0x2310")
    hand.misses("No alarms")
    if not hand.can_see("Show the signals ± 5 s"):
        hand.click("fault: right hip")
    hand.keep("fault")
    hand.insist("Show the signals ± 5 s", lambda: hand.reads("right_hip."))
    hand.keep("fault-signal")
    hand.click("Overview")
    clear_fault(hand, "fault: right hip")
    none_enabled(hand)
    walks_again(bench)


def fault_replayed(bench: Bench) -> None:
    """The recording of it: its event leads to the instant, the alarm of then is there, and its signal."""
    hand = bench.hand
    hand.key("F9")  # without the panels there is room for it
    play_newest(hand)
    hand.misses("looking for events", within_s=AGAIN_S)
    hand.click("Events of the recording")
    event = until(lambda: next(filter(FAULT_EVENT.match, hand.names()), None), "listed the fault's event")
    hand.keep("replay-events")
    hand.click(event)
    hand.sees("fault: right hip", "0x2310", within_s=AGAIN_S)
    if hand.can_see("Pause"):
        hand.click("Pause", exactly=True)
    hand.misses("Clear fault…") if not hand.can_see("Clear fault…") else None
    hand.keep("replay-fault")
    if not hand.can_see("Show the signals ± 5 s"):
        hand.click("fault: right hip", place=-1)
    hand.insist("Show the signals ± 5 s", lambda: hand.reads("right_hip."), place=-1)
    hand.keep("replay-fault-signal")
    hand.click("← All")
    hand.key("F9")
    hand.click("Overview")


def play_newest(hand: Hand) -> None:
    """The recording that goes on, from its beginning."""
    hand.click("Recordings")
    today = time.strftime("%Y-%m-%d")
    hand.sees(today, within_s=AGAIN_S)
    hand.insist(today, lambda: hand.can_see("Play"), place=-1)
    hand.insist("Play", lambda: hand.reads("PLAYBACK, not live"), exactly=True)
    hand.misses("reading …", within_s=AGAIN_S)


def clear_fault(hand: Hand, alarm: str) -> None:
    """By the button of its alarm, which is opened where others stand before it."""
    if not hand.can_see("Clear fault…"):
        hand.click(alarm)
    hand.click("Clear fault…")
    hand.keep("clear-fault")
    hand.click("Clear fault", exactly=True)
    hand.misses(alarm)


def insole_lost(bench: Bench) -> None:
    """A foot of which nothing is known carries no load, not none."""
    hand = bench.hand
    bench.robot.break_("sensor_unplugged", "left_insole")
    hand.sees("lost: left insole")
    hand.turn_to("Wearer")
    hand.reach("left insole: lost")
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
    hand.sees("main: ", "of its time is taken", within_s=AGAIN_S)
    hand.keep("bus-full")
    bench.robot.mend()
    bench.robot.break_("bus_off", "left_knee")
    hand.sees("left knee", "heartbeat", within_s=AGAIN_S)
    hand.keep("bus-off")
    bench.robot.mend()
    hand.click("Overview")


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
