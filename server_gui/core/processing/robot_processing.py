"""Everything that is made of one robot's events: the three modules behind one `apply`."""

import time

from gateway.wire.robot import Description
from server_gui.core.follow.events import (
    BusesSeen,
    Described,
    Event,
    LinkChanged,
    Looked,
    Refused,
    Resources,
    Telemetry,
)
from server_gui.core.processing.bus_loads import BusLoads
from server_gui.core.processing.communication import LinkMonitor, LinkQuality
from server_gui.core.processing.component import ComponentProcessing, Derived
from server_gui.core.processing.resource import ResourceProcessing


class RobotProcessing:
    """Fed with the same events as `server_gui.core.follow.robot.Robot`, by one thread; views only read.

    A robot that was started again has another clock: what was derived from its samples begins anew, what is
    known of its link and computer stays.
    """

    def __init__(self) -> None:
        self.component = ComponentProcessing()
        self.resource = ResourceProcessing()
        self.communication = LinkMonitor()
        self.bus_loads = BusLoads()
        self._boot_id: str | None = None

    def apply(self, event: Event) -> None:
        """Take one fact."""
        match event:
            case Telemetry(batch=batch):
                self.communication.take(event.stream, batch, event.age_ns)
                self.component.take(batch.stamps_ns, batch.columns)
            case Resources():
                self.resource.take(event.snapshot)
                self.communication.round_trip(event.round_trip_ns)
            case BusesSeen():
                self.bus_loads.take(event.buses, event.at_ns)
            case LinkChanged():
                self.communication.state(event.state, event.problem, event.at_ns)
            case Looked():
                quality = event.quality.quality
                self.component.distrusted = frozenset(
                    name for name, found in quality.items() if found.get("state") == "fault"
                )
            case Described():
                self._described(event.description)
                self.communication.calendar(event.calendar_ns)
            case Refused():
                self.communication.refused(event.reason, time.monotonic_ns())
            case _:
                pass  # writes and stops change nothing here

    def derived(self) -> Derived:
        """Return derived values of wearer and joints, as of the newest row."""
        return self.component.shown()

    def link(self, now_ns: int | None = None) -> LinkQuality:
        """Return how well the robot is reached."""
        return self.communication.quality(time.monotonic_ns() if now_ns is None else now_ns)

    def _described(self, description: Description) -> None:
        if self._boot_id not in (None, description.boot_id):
            self.component.restart()
        self._boot_id = description.boot_id
