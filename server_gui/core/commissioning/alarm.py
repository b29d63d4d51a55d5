"""The alarms of robots that were commissioned here, and have not confirmed their STOP: no list has them."""

from typing import Final

from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.commissioning.commissioning import Commissioning

NOT_EVERY: Final = "not every drive has confirmed it"


def unstopped(commissioning: Commissioning) -> list[Alarm]:
    """Return them: also of one that was commissioned before, until its STOP is confirmed."""
    check = check_of(Kind.NOT_STOPPED)
    return [
        Alarm(
            Kind.NOT_STOPPED, f"commissioned {place}", one.why or NOT_EVERY, one.name, "", check, one.since_s
        )
        for place, one in commissioning.unconfirmed.items()
    ]
