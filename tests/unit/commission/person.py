"""A robot of unknown drives, and somebody who reads what is asked, moves its joints by hand and types."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from eds.shipped import SHIPPED
from gateway.commission.dialogue import Ask
from hil_sim.control_socket import ask
from hil_sim.exoskeleton import JOINTS
from hil_sim.mounting import Mounting

# Three makers, shuffled ids, motors the other way round, zeros anywhere.
MOUNTINGS = {
    "left_hip": Mounting(11, -1, 12_000),
    "left_knee": Mounting(7, 1, -30_500),
    "left_ankle": Mounting(23),
    "right_hip": Mounting(2, 1, 4_096),
    "right_knee": Mounting(40, -1, 0),
    "right_ankle": Mounting(3, -1, -777),
}
DRIVES = {
    "left_hip": SHIPPED / "trinamic_tmcm_1270.eds",
    "right_hip": SHIPPED / "trinamic_tmcm_1270.eds",
    "right_knee": SHIPPED / "elmo_gold.dcf",
}
POSTURES = {"Stand upright": [0, 0], "Lean forward": [25, 0], "Lean to your left": [0, 25]}
STRAIGHT, BENT = 2.0, 47.0


class Person:
    """Does what is asked with the hands, and types."""

    def __init__(self, folder: Path) -> None:
        self.read: list[str] = []
        self._folder = folder

    def say(self, text: str) -> None:
        assert not re.search(r"\S  +\S", text), text
        self.read.append(text)

    def moving(self, text: str) -> str:
        raise AssertionError(f"nobody agreed to a motion: {text}")

    def ask(self, question: Ask) -> str:
        self.say(question.text)
        assert len(self.read) < 150, self.read[:12]
        return self._answer(question)

    def _answer(self, question: Ask) -> str:
        asked = question.text
        joint = next((name for name in JOINTS if name.replace("_", " ") in asked), "")
        if "Are these all" in asked:
            return "all" if asked.startswith("6 ") else "again"
        if "What is the robot called" in asked:
            return "exo-01"
        if asked.startswith("Bend the"):
            self._move(joint, 60.0)
        elif "Hold the" in asked:
            angle = STRAIGHT if "one known angle" in asked else BENT
            self._move(joint, angle)
            return f"{angle:g}"
        elif "as straight as" in asked:
            self._move(joint, -5.0)
        elif "as bent as" in asked:
            self._move(joint, 90.0)
        elif "Counts of its encoder" in asked:
            return "4096"
        elif "Which node commands" in asked:
            return "16"
        elif "Which of its objects stops" in asked:
            return "0x2000:0"
        elif "rated current" in asked:
            return "5"
        elif "rated torque" in asked:
            return "40"
        elif (
            asked.startswith("Write this")
            or "its file?" in asked
            or "heartbeat" in asked
            or "May the" in asked
        ):
            return "y"
        elif "stamp with" in asked:
            ask(self._folder, {"stamp": "left" if "left" in asked else "right"})
        for posture, lean in POSTURES.items():
            if asked.startswith(posture):
                ask(self._folder, {"lean": lean})
        return ""

    def _move(self, joint: str, degrees: float) -> None:
        ask(self._folder, {"hand": joint, "degrees": degrees})


@contextmanager
def emergency_stop(folder: Path) -> Iterator[None]:
    """No drive has power while it is pressed; then all walks as before, and nobody lays a hand on it."""
    ask(folder, {"controller": "stop"})
    for joint in JOINTS:
        ask(folder, {"fault": "sto", "on": joint})
    yield
    for request in ({"clear": "all"}, {"stamp": "nobody"}, {"lean": [0, 0]}, {"controller": "start"}):
        ask(folder, request)
