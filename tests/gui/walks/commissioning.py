"""A moment at a bus of unknown drives: the page asks, a joint is moved by hand, and STOP ends it."""

import json
from typing import Final

from hil_sim.control_socket import ask
from server_gui.processes.children import Child
from tests.gui.walks.hand import Hand
from tests.gui.walks.robot import AGAIN_S
from tests.gui.walks.walk import Bench
from tests.support.waiting import WAIT_S, until
from tests.unit.commission.person import emergency_stop

BENT: Final = {"hand": "left_hip", "degrees": 60}
MOUNTED: Final = ("left_hip=11,-1,12000", "left_knee=7", "right_knee=40", "right_ankle=23")


def commissioned(bench: Bench) -> None:
    """Name and joints are asked; the drive that counts is seen while a joint is bent; STOP ends it."""
    hand, folder = bench.hand, bench.folder / "unknown"
    mounted = (word for one in MOUNTED for word in ("--mount", one))
    simulator = bench.ends.enter_context(
        Child("simulator", ["sim", "--dir", str(folder), "--scenario", "stand", *mounted])
    )
    simulator.wait_ready(lambda line: json.loads(line).get("ready"), WAIT_S, lambda: None)
    with emergency_stop(folder):
        hand.key("alt+n")
        hand.click("Commission: Robot's file")
        hand.type(str(bench.folder / "exo-01.toml"))
        hand.click("Commission: CAN bus")
        hand.type(str(folder / "robot.toml"))
        hand.keep("commission-form")
        hand.click("Start", exactly=True)
        until(lambda: _answered(hand), "it asked to bend a joint", AGAIN_S)
        ask(folder, BENT)
        until(lambda: _has_moved(hand), "the drive was seen to count", AGAIN_S)
        hand.keep("commission")
        hand.click("STOP the drives that are commissioned")
        hand.sees("STOP confirmed")
        hand.keep("commission-stopped")
    hand.click("Overview")


def _answered(hand: Hand) -> bool:
    """Answer whatever is asked with what it offers, until a joint is to be bent."""
    if hand.reads("Bend the left hip", "keep it there"):
        return True
    if hand.reads("What is the robot called"):
        hand.click("Answer: What is the robot called")
        hand.type("exo-01")
        hand.key("Return")
        hand.misses("What is the robot called")
    elif hand.reads("Which node commands the drives"):  # also where its answers are not in sight yet
        hand.click("Answer: None", exactly=True)  # nothing is offered: Enter is to leave no controller out
        hand.misses("Which node commands the drives")
    elif hand.can_see("Answer: "):
        hand.key("Return")
    return False


def _has_moved(hand: Hand) -> bool:
    told = [text.lstrip("−").split()[0] for text in hand.ask(texts=1) if "counts moved" in text]
    return any(int(count) > 1000 for count in told if count.isdigit())
