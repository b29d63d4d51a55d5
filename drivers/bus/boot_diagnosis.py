"""The step at which a booting node is stuck, in words, and what to check."""

from collections.abc import Collection

from drivers.bus.liveness import NodeLife
from drivers.bus.nmt import NmtState

OVERLOAD_PERCENT = 95.0  # of the bus's time: higher identifiers hardly pass any more
_PDO_BASES = (0x180, 0x280, 0x380, 0x480)  # of the predefined connection set


def why_silent(
    life: NodeLife,
    node_id: int,
    request_id: int,
    bus_name: str,
    frames: int,
    unclaimed: Collection[int],
    load_percent: float | None = None,
) -> str | None:
    """Return why no SDO is answered, from what else is heard; `None` if the node does talk SDO."""
    no_sdo = f"it answers no SDO on 0x{request_id:03X}: is another SDO client using this channel?"
    if life.nmt_state is NmtState.STOPPED:
        return "it is stopped (NMT) and answers no SDO until its master starts it"
    if life.heartbeat_ns is not None:
        state = "" if life.nmt_state is None else f" ({life.nmt_state.words})"
        return f"its heartbeat comes{state}, but {no_sdo}"
    if life.heard_ns is not None:
        return None
    if any(base + node_id in unclaimed for base in _PDO_BASES):
        return f"PDOs of node {node_id} come, but {no_sdo}"
    if frames == 0:
        return f"no frame at all on bus {bus_name}: check bitrate, wiring, termination and power"
    if load_percent is not None and load_percent >= OVERLOAD_PERCENT:
        return (
            f"nothing comes through from node {node_id}: the bus {bus_name} is overloaded, "
            f"{load_percent:.0f} % of its time is taken: find what sends so much (candump)"
        )
    return (
        f"no frame at all from node {node_id}, others are heard on bus {bus_name}: "
        "check its power, cable and node id"
    )
