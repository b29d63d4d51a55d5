"""The alarm of a robot that is commissioned here, and has not confirmed its STOP: no list has it."""

from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.stages import Stage

NOT_EVERY: Final = "not every drive has confirmed it"


def unstopped(commissioning: Commissioning) -> Alarm | None:
    """Return it; None where it is not so."""
    if commissioning.stage is not Stage.NOT_CONFIRMED:
        return None
    name = commissioning.name
    what, check = commissioning.problem or NOT_EVERY, check_of(Kind.NOT_STOPPED)
    since_s = commissioning.since_s
    return Alarm(Kind.NOT_STOPPED, f"commissioned {name}", what, name, check=check, since_s=since_s)
