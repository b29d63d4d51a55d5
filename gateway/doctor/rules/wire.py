"""Of the wires: bit rate, termination, two nodes with one id, a second SDO client, load."""

from collections.abc import Iterator

from drivers.bus.interfaces.controller_state import BusState
from drivers.bus.settings import CanSettings
from gateway.config.robot import header
from gateway.doctor.observations import BusFacts, Observations
from gateway.doctor.verdicts import Advice, Edit, Finding, Fix, Run, Unknown, Verdict, Write

BUSY_PERCENT = 70.0
ERRORS_PER_S = 1.0
TWICE = 1.5  # times as often as one node alone sends
OTHERS_ASK, OTHERS_SHARE = 10, 1.3  # transfers beyond those of the gateway that somebody else begins
# As networks of drives are set up, the usual first; an EDS names those that its device has (CiA 306 §4.4.3).
RATES = (1_000_000, 500_000, 250_000, 125_000, 800_000, 50_000, 20_000, 10_000)
_ADVICE = Advice(
    "measure the bus without power: 60 Ω between CAN_H and CAN_L; 120 Ω: a terminator is missing"
)
UNSEEN = BusFacts(0.0, None, None, None, None, BusState.ACTIVE)
_SILENT = "nothing was heard on it: check power, wiring and bit rate"


def bit_rate(seen: Observations) -> Iterator[Verdict]:
    """Errors and not one frame; or the link runs at another rate than the file says."""
    for name, settings in seen.config.can.items():
        facts = seen.buses.get(name, UNSEEN)
        trouble = facts.trouble or seen.bus_obstacles.get(name) or ""
        if "bit/s" in trouble:
            command = trouble.partition("run: ")[2]
            yield _wrong_rate(seen, name, (trouble.partition(";")[0],), (Run(command),) if command else ())
        elif not facts.is_silent:
            continue
        elif facts.error_frames_per_s or facts.state in (BusState.PASSIVE, BusState.OFF):
            evidence = (
                f"no frame in {facts.seconds:.0f} s, and {facts.error_frames_per_s or 0:.0f} error frames/s",
                f"its controller is {facts.state.name.lower()}",
            )
            yield _wrong_rate(seen, name, evidence, tuple(_other_rates(seen, name, settings)))
        else:
            yield Unknown("bit_rate", header("can", name), seen.bus_obstacles.get(name, _SILENT))


def _wrong_rate(seen: Observations, name: str, evidence: tuple[str, ...], fixes: tuple[Fix, ...]) -> Finding:
    rate = seen.config.can[name].bitrate
    said = "the rate that it was opened with" if rate is None else f"{rate} bit/s"
    words = f"the devices on it talk at another bit rate than {said}"
    return Finding("bit_rate", header("can", name), words, evidence, (*fixes, _ADVICE))


def _other_rates(seen: Observations, name: str, settings: CanSettings) -> Iterator[Fix]:
    for rate in RATES:
        if rate == settings.bitrate or not _all_have(seen, name, rate):
            continue
        yield Edit("can", name, "bitrate", rate, settings.bitrate)
        if settings.interface == "socketcan":
            link = settings.channel
            yield Run(f"sudo ip link set {link} down && sudo ip link set {link} up type can bitrate {rate}")


def _all_have(seen: Observations, bus: str, rate: int) -> bool:
    """Return whether every device's file names that rate."""
    tables = (place for place in seen.nodes() if place.table.bus == bus)
    files = [seen.descriptions[place.name] for place in tables if place.name in seen.descriptions]
    named = [getattr(one.object_dictionary.device_information, "allowed_baudrates", None) for one in files]
    return all(rate in rates for rates in named if rates)


def terminator(seen: Observations) -> Iterator[Verdict]:
    """Frames come, and error frames among them all the time."""
    for name in seen.config.can:
        facts, about = seen.buses.get(name, UNSEEN), header("can", name)
        if facts.error_frames_per_s is None:
            yield Unknown("terminator", about, "its interface tells no error frames")
        elif facts.is_silent:
            yield Unknown("terminator", about, seen.bus_obstacles.get(name, _SILENT))
        elif facts.error_frames_per_s >= ERRORS_PER_S:
            share = 100 * facts.error_frames_per_s / ((facts.frames_per_s or 0) + facts.error_frames_per_s)
            errors = f"{facts.error_frames_per_s:.0f} error frames/s ({share:.0f} %)"
            evidence = (
                f"{errors} beside {facts.frames_per_s or 0:.0f} frames/s",
                f"its controller is error {facts.state.name.lower()}",
            )
            words = (
                "frames are destroyed on the wire: no terminator, one too many, a short or a loose contact"
            )
            look = Advice("look at each plug, and unplug one device after the other until errors end")
            yield Finding("terminator", about, words, evidence, (_ADVICE, look))


def double_node_id(seen: Observations) -> Iterator[Verdict]:
    """Heartbeats, or PDOs on SYNC, come more often than one node sends them."""
    for place in seen.nodes():
        facts = seen.buses.get(place.table.bus)
        if facts is None or facts.heard is None or facts.is_silent:
            yield Unknown("double_node_id", place.header, "its bus was not listened to, or is silent")
            continue
        node, period_ms = place.table.node_id, seen.whole(place, 0x1017)
        evidence = tuple(_twice(facts, node, period_ms))
        if evidence:
            words = f"two devices on {place.table.bus!r} have node id {node}"
            unplug = Advice(
                f"unplug devices until one answers as {node}, then give the other an id of its own "
                "by its switches or LSS (gwrms scan shows who is there)"
            )
            yield Finding("double_node_id", place.header, words, evidence, (unplug,))
        elif period_ms is None and 0x180 + node not in facts.heard:
            yield Unknown("double_node_id", place.header, seen.why_no_objects)


def _twice(facts: BusFacts, node: int, period_ms: int | None) -> Iterator[str]:
    heard = facts.heard or {}
    beats = heard.get(0x700 + node)
    if beats is not None and period_ms and beats.count > 3 and beats.per_s > TWICE * 1000 / period_ms:
        yield f"{beats.per_s:.1f} heartbeats/s, and its 1017h says {1000 / period_ms:.1f}"
    sync = heard.get(0x080)
    for base in (0x180, 0x280, 0x380, 0x480):
        pdo = heard.get(base + node)
        if sync is not None and pdo is not None and sync.count > 3 and pdo.per_s > TWICE * sync.per_s:
            others = [one.per_s for id_, one in heard.items() if id_ & 0x780 == base and id_ != base + node]
            if others and max(others) <= TWICE * sync.per_s:
                yield f"0x{base + node:X} comes {pdo.per_s:.0f} times/s, SYNC {sync.per_s:.0f} times/s"


def second_sdo_client(seen: Observations) -> Iterator[Verdict]:
    """SDO requests that are none of the gateway's, on the channel that it uses."""
    for place in seen.nodes():
        facts = seen.buses.get(place.table.bus)
        if facts is None or facts.heard is None or facts.is_silent:
            yield Unknown("second_sdo_client", place.header, "its bus was not listened to, or is silent")
            continue
        request = place.table.sdo_ids(place.table.node_id)[0]
        heard = facts.heard.get(request)
        ours = facts.asked_by_us.get(place.table.node_id, 0)
        if heard is None or heard.asks < max(ours * OTHERS_SHARE, ours + OTHERS_ASK):
            continue
        begun = f"{heard.asks} SDO transfers begun on 0x{request:X} in {facts.seconds:.0f} s"
        evidence = (f"{begun}, {ours} of them by the gateway",)
        words = "somebody else asks it by SDO on our channel: each may take the other's answers for its own"
        node = place.table.node_id
        yield Finding(
            "second_sdo_client",
            place.header,
            words,
            evidence,
            (
                Advice(f"end the other program that sends 0x{request:X} (candump shows when)"),
                Advice(
                    f"give the gateway a channel of its own: a second SDO server (1201h) on node {node}, "
                    f"then sdo_cob_ids = [request, response] in {place.header}"
                ),
            ),
        )


def bus_load(seen: Observations) -> Iterator[Verdict]:
    """More of its time is taken than leaves room for bursts."""
    for name in seen.config.can:
        facts, about = seen.buses.get(name, UNSEEN), header("can", name)
        if facts.load_percent is None:
            yield Unknown("bus_load", about, f"its load is not known: bitrate is needed in {about}")
        elif facts.load_percent >= BUSY_PERCENT:
            evidence = (
                f"{facts.load_percent:.0f} % of its time is taken by {facts.frames_per_s or 0:.0f} frames/s",
                *_loudest(facts),
            )
            words = "the bus is too busy for the rates that are wanted: low priorities come late, or never"
            yield Finding("bus_load", about, words, evidence, tuple(_less(seen, name, facts)))


def _loudest(facts: BusFacts) -> Iterator[str]:
    rows = sorted((facts.heard or {}).items(), key=lambda row: -row[1].per_s)[:3]
    if rows:
        yield "most: " + ", ".join(f"0x{id_:X} {one.per_s:.0f}/s" for id_, one in rows)


def _less(seen: Observations, bus: str, facts: BusFacts) -> Iterator[Fix]:
    heard = facts.heard or {}
    known = {
        base + place.table.node_id
        for place in seen.nodes()
        if place.table.bus == bus
        for base in (0x80, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700)
    }
    loudest = max(heard, key=lambda id_: heard[id_].per_s, default=None)
    if loudest is not None and loudest not in known and loudest != 0x080:
        yield Advice(f"end who sends 0x{loudest:X}: no device of the robot's file does")
    for place in seen.nodes():
        period = seen.whole(place, 0x1006)
        if place.table.bus == bus and period:
            yield Write(place.name, 0x1006, 0, 2 * period, period)
    yield Advice("map fewer objects, or send PDOs on every second SYNC (1800h:2 = 2)")
