"""The states of commissioning as a window shows them: a table, so that none is forgotten."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from server_gui.core.alarms.marks import Mark


class Stage(Enum):
    """Stage of commissioning."""

    NOT_STARTED = "not started"
    STARTING = "starting"
    WORKING = "working"
    ASKING = "asking"
    HAND = "waiting for your hand"
    MOVING = "under power"
    BUS_GONE = "a drive does not answer"
    STOPPING = "STOP sent"
    STOPPED = "STOP confirmed"
    NOT_CONFIRMED = "STOP NOT CONFIRMED"
    ENDING = "being ended"
    WRITTEN = "written"
    UNUSABLE = "written, not usable yet"
    LEFT = "interrupted"
    FAILED = "failed"
    DIED = "died"


@dataclass(frozen=True, slots=True)
class StageView:
    """Appearance of a stage, and its possible actions."""

    mark: Mark
    words: str
    runs: bool = False  # the command does: it can be stopped and interrupted
    answers: bool = False


GO_ON: Final = "What was found is kept: “Go on” takes it up again."
BY_HAND: Final = "Use the hardware emergency stop."
LOOKS: Final = {
    Stage.NOT_STARTED: StageView(
        Mark("ring", "dim", "not started"),
        "You move the joints by hand, without power; only homing, on your word, puts one under power.",
    ),
    Stage.STARTING: StageView(Mark("half", "accent", "starting"), "The command is starting …", runs=True),
    Stage.WORKING: StageView(
        Mark("half", "accent", "working"), "It works; its next question comes by itself.", runs=True
    ),
    Stage.ASKING: StageView(
        Mark("diamond", "accent", "asking"), "It waits for your answer.", runs=True, answers=True
    ),
    Stage.HAND: StageView(
        Mark("diamond", "accent", "waiting for your hand"),
        "It waits for your hand, then your answer.",
        runs=True,
        answers=True,
    ),
    Stage.BUS_GONE: StageView(
        Mark("triangle", "warn", "no answer"),
        "A drive does not answer: see to its supply and the bus.",
        runs=True,
        answers=True,
    ),
    Stage.MOVING: StageView(
        Mark("triangle", "warn", "UNDER POWER"),
        "A joint is under power and may move: hands off. STOP ends it.",
        runs=True,
    ),
    Stage.STOPPING: StageView(
        Mark("triangle", "warn", "STOP sent"), "STOP is sent, and not confirmed yet …", runs=True
    ),
    Stage.STOPPED: StageView(
        Mark("triangle", "warn", "STOP confirmed"), f"Every drive has confirmed the STOP. {GO_ON}"
    ),
    Stage.NOT_CONFIRMED: StageView(Mark("square", "bad", "STOP NOT CONFIRMED"), BY_HAND),
    Stage.ENDING: StageView(Mark("half", "dim", "ending"), "The command is ending …", runs=True),
    Stage.WRITTEN: StageView(
        Mark("disc", "good", "written"), "The robot's file is written, and can be used."
    ),
    Stage.UNUSABLE: StageView(
        Mark("triangle", "warn", "not usable yet"),
        f"The file is written, and cannot be used as it is. {GO_ON}",
    ),
    Stage.LEFT: StageView(
        Mark("ring", "warn", "interrupted"), f"It has ended without all of the file. {GO_ON}"
    ),
    Stage.FAILED: StageView(Mark("triangle", "bad", "failed"), "It could not go on."),
    Stage.DIED: StageView(
        Mark("triangle", "bad", "died"),
        f"The command has died: how the drives are is not known. {BY_HAND} STOP here asks those that were "
        f"found. {GO_ON}",
    ),
}
