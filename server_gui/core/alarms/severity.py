"""How bad a thing is, by the one table of alarms: for an event of it, and for the bus that it is on."""

from collections.abc import Collection, Iterator

from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.marks import NEWS, Mark
from server_gui.core.follow.news import Item
from server_gui.core.processing.bus_health import BusHealthLevel

SOON_S = 3.0  # an alarm is found so soon before or after its event


def event_mark(item: Item, alarms: Alarms | None) -> Mark:
    """Return the mark of an event: while the alarm about the same thing lasts, as bad as that is."""
    own = NEWS[item.kind]
    about = [] if alarms is None or not item.about else [*_since(alarms, item)]
    worst = min(about, key=lambda alarm: alarm.rank, default=None)
    return own if worst is None else Mark(worst.mark.shape, worst.mark.colour, own.word)


def worst_of(subjects: Collection[str], alarms: Alarms) -> Mark:
    """Return the mark of the worst alarm about some components; without one, that something is wrong."""
    about = (alarm for alarm in alarms.each if alarm.subject in subjects)
    worst = min(about, key=lambda alarm: alarm.rank, default=None)
    return Mark("square", "bad") if worst is None else worst.mark


def colour_of(subject: str, alarms: Alarms, otherwise: str = "bad") -> str:
    """Return the colour of the worst alarm about a component; `otherwise` where there is none."""
    about = (alarm for alarm in alarms.each if alarm.subject == subject)
    worst = min(about, key=lambda alarm: alarm.rank, default=None)
    return otherwise if worst is None else worst.mark.colour


def bus_level(own: BusHealthLevel, bus: str, alarms: Alarms) -> BusHealthLevel:
    """Return how bad a bus is: no better than the alarms about it and about its nodes."""
    told = [alarm.mark.colour for alarm in _on(bus, alarms)]
    if "bad" in told:
        return BusHealthLevel.ALARM
    return BusHealthLevel.WARNING if "warn" in told and own is not BusHealthLevel.ALARM else own


def worsened_by(own: BusHealthLevel, bus: str, alarms: Alarms) -> Alarm | None:
    """Return the alarm of a node by which a bus is worse than by itself; None where it is not."""
    if (bad := bus_level(own, bus, alarms)) is own:
        return None
    colour = "bad" if bad is BusHealthLevel.ALARM else "warn"
    of_nodes = (
        alarm
        for alarm in _on(bus, alarms)
        if alarm.mark.colour == colour and not alarm.subject.startswith("bus.")
    )
    return min(of_nodes, key=lambda alarm: alarm.rank, default=None)


def bus_mark(level: BusHealthLevel, bus: str, alarms: Alarms) -> Mark | None:
    """Return the mark of the worst alarm about a bus or its nodes; None where none is as bad as the bus."""
    colour = {BusHealthLevel.ALARM: "bad", BusHealthLevel.WARNING: "warn"}.get(level)
    as_bad = (alarm for alarm in _on(bus, alarms) if alarm.mark.colour == colour)
    worst = min(as_bad, key=lambda alarm: alarm.rank, default=None)
    return None if worst is None else worst.mark


def _on(bus: str, alarms: Alarms) -> list[Alarm]:
    """About a bus or its nodes."""
    return [alarm for alarm in alarms.each if bus in (alarm.node, alarm.subject.removeprefix("bus."))]


def _since(alarms: Alarms, item: Item) -> Iterator[Alarm]:
    for active in alarms.active:
        if item.utc_s >= active.since_s - SOON_S:
            yield from (one for one in (active.alarm, *active.alarm.under) if one.subject == item.about)
