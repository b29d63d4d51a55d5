"""The robot's computer in words: load, temperatures, cost of monitoring, memory leaks."""

from typing import Final

from msgspec import UNSET

from gateway.wire.cost import GatewayCost
from gateway.wire.resource import ResourceSnapshot
from server_gui.core.desk.station import Station

MIB: Final = 1 << 20
KIB: Final = 1 << 10
CLIENTS: Final = 4  # those that cost the most


def facts(station: Station, seen: ResourceSnapshot) -> str:
    """Return the facts, a line each."""
    load = " ".join(f"{one:.2f}" for one in seen.cpu.load)
    lines = [f"Load over 1, 5 and 15 minutes: {load}", f"Gateway: {seen.gateway.rss_bytes / MIB:.1f} MiB"]
    table = station.processes
    if table is not None and table.thermal is not UNSET:
        known = [f"{name} {value:.0f} °C" for name, value in table.thermal.items() if value is not None]
        lines.append(f"Temperatures: {', '.join(known) or 'this computer reports none'}")
    lines += _costs(station.cost)
    if seen.memory.swap_used:
        lines.append(f"Swapped out: {seen.memory.swap_used / MIB:.0f} MiB")
    lines += [f"▲ {leak.text}" for leak in station.processing.resource.leaks()]
    return "\n".join(lines)


def held_back(seen: ResourceSnapshot | None) -> str:
    """Return how far the cores are held back because it is too hot, or for power."""
    if seen is None or seen.throttling is UNSET:
        return ""
    told = seen.throttling
    said = [f"▲ too hot {told.events}× since its start"] if told.events else []
    said += [f"▲ {name} holds back {100 * share:.0f} %" for name, share in told.cooling.items() if share]
    slowest = min((share for share in told.frequency if share is not None), default=None)
    if slowest is not None:
        said.append(f"slowest core at {100 * slowest:.0f} % of its frequency")
    return " · ".join(said) or "the cores are not throttled"


def _costs(cost: GatewayCost | None) -> list[str]:
    """Return the gateway's cost by client, the largest first."""
    if cost is None or cost.wake_ups_per_s is None:
        return []
    lines = [f"Monitoring wakes the computer {cost.wake_ups_per_s:.0f} times a second; for"]
    known = [one for one in cost.clients if one.cpu_percent is not None]
    clients = sorted(known, key=lambda one: -(one.cpu_percent or 0.0))
    for one in clients[:CLIENTS]:
        sent = "–" if one.sent_bytes_per_s is None else f"{one.sent_bytes_per_s / KIB:.0f}"
        lines.append(f"   {one.who}: {one.cpu_percent or 0.0:.1f} % of a core, {sent} KiB/s")
    if cost.budget is not None and cost.budget.shed > 1:
        lines.append(f"▲ To keep to its budget the robot sends one row of {cost.budget.shed}")
    return lines
