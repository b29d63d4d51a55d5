"""Of the nodes: whose EDS, heartbeat, SYNC, what the PDOs bring."""

from collections.abc import Iterator
from itertools import count

from gateway.doctor.observations import Observations, Place
from gateway.doctor.verdicts import Advice, Edit, Finding, Fix, Unknown, Verdict, Write

HEARTBEAT_MS = 100
USUAL_FACTOR = 2.5  # of 1017h: what the gateway waits for a heartbeat where the file says nothing
SLOWEST_SYNC_S = 0.025  # a joint of a walker goes 2° meanwhile
SYNC_TOLERANCE = 0.2
NOT_VALID = 0x8000_0000
POSITION, STATUSWORD, VELOCITY = 0x6064, 0x6041, 0x606C
_PDO_NAMES = {POSITION: "position", STATUSWORD: "statusword"}
_TPDOS = range(4)


def eds_product(seen: Observations) -> Iterator[Verdict]:
    """Yield devices whose identity (1018h) is not that of their EDS."""
    for place in seen.nodes():
        description = seen.descriptions.get(place.name)
        vendor, product = seen.whole(place, 0x1018, 1), seen.whole(place, 0x1018, 2)
        if description is None or vendor is None:
            why = "its EDS cannot be read (gwrms check)" if description is None else seen.why_no_objects
            yield Unknown("eds_product", place.header, why)
            continue
        if not description.vendor_id and not description.product_code:
            yield Unknown(
                "eds_product", place.header, f"{place.table.eds} does not say for which product it is"
            )
            continue
        evidence = tuple(_differences(place, seen, vendor, product))
        if not evidence:
            continue
        other = seen.proposals.get(place.name)
        fixes: tuple[Fix, ...] = (
            Advice(
                f"take the EDS of vendor 0x{vendor:X}, product 0x{product or 0:X} from its maker: eds = …"
            ),
        )
        if other is not None and other != place.table.eds:
            fixes = (Edit(place.kind, place.name, "eds", other, place.table.eds), *fixes)
        words = f"{place.table.eds} was written for another product or revision"
        yield Finding("eds_product", place.header, words, evidence, fixes)


def _differences(place: Place, seen: Observations, vendor: int, product: int | None) -> Iterator[str]:
    description = seen.descriptions[place.name]
    if description.vendor_id and vendor != description.vendor_id:
        yield f"1018h:1 (vendor) is 0x{vendor:X}, the file is for 0x{description.vendor_id:X}"
    if description.product_code and product not in (None, description.product_code):
        yield f"1018h:2 (product) is 0x{product:X}, the file is for 0x{description.product_code:X}"
    variable, revision = description.variable(0x1018, 3), seen.whole(place, 0x1018, 3)
    said = None if variable is None else variable.default
    if isinstance(said, int) and said and revision is not None and revision >> 16 != said >> 16:
        yield f"1018h:3 (revision) is 0x{revision:X}, the file is for 0x{said:X}"


def heartbeat(seen: Observations) -> Iterator[Verdict]:
    """No heartbeat, or one that is slower than those who wait for it."""
    for place in seen.nodes():
        period_ms = seen.whole(place, 0x1017)
        heard = _hears(seen, place)
        timeout_s = place.table.heartbeat_timeout_s
        if period_ms is None and heard is None:
            yield Unknown("heartbeat", place.header, seen.why_no_objects)
        elif period_ms == 0 or (period_ms is None and not heard):
            yield _no_heartbeat(seen, place, period_ms)
        elif heard is False:
            words = "no heartbeat of it was heard, though it says that it sends them"
            evidence = (f"1017h = {period_ms} ms, and no frame 0x{0x700 + place.table.node_id:X}",)
            power = Advice("check its power and its plug; gwrms scan tells who is on the bus")
            yield Finding("heartbeat", place.header, words, evidence, (power,))
        elif period_ms is not None and timeout_s is not None and period_ms / 1000 >= timeout_s:
            yield _too_slow(place, period_ms, timeout_s)


def _hears(seen: Observations, place: Place) -> bool | None:
    """Return whether its heartbeat was heard; `None` if its bus was not listened to, or is silent."""
    ids = seen.heard_on(place.table.bus)
    return None if ids is None else 0x700 + place.table.node_id in ids


def _no_heartbeat(seen: Observations, place: Place, period_ms: int | None) -> Finding:
    others = [seen.whole(other, 0x1017) for other in seen.nodes()]
    timeout_s = place.table.heartbeat_timeout_s
    usual = max((one for one in others if one), default=HEARTBEAT_MS)
    wanted = usual if timeout_s is None else min(usual, max(1, round(1000 * timeout_s / USUAL_FACTOR)))
    facts = seen.buses.get(place.table.bus)
    evidence = [] if period_ms is None else [f"1017h = {period_ms}"]
    if facts is not None and facts.heard is not None:
        evidence.append(f"no frame 0x{0x700 + place.table.node_id:X} in {facts.seconds:.1f} s")
    return Finding(
        "heartbeat",
        place.header,
        "it sends no heartbeat: its death is noticed late",
        tuple(evidence),
        (
            Write(place.name, 0x1017, 0, wanted, period_ms),
            Advice(
                f'where the gateway refuses: [parameter."{place.name}.heartbeat"] object = "0x1017:0" in the '
                "robot's file, or the drive's own software; then gwrms store, so that it stays"
            ),
        ),
    )


def _too_slow(place: Place, period_ms: int, timeout_s: float) -> Finding:
    wanted = round(USUAL_FACTOR * period_ms / 1000, 3)
    return Finding(
        "heartbeat",
        place.header,
        "its heartbeat is slower than what waits for it: it counts as lost again and again",
        (f"1017h = {period_ms} ms, heartbeat_timeout_s = {timeout_s:g}",),
        (
            Edit(place.kind, place.name, "heartbeat_timeout_s", wanted, timeout_s),
            Write(place.name, 0x1017, 0, max(1, round(1000 * timeout_s / USUAL_FACTOR)), period_ms),
        ),
    )


def sync(seen: Observations) -> Iterator[Verdict]:
    """No SYNC for PDOs that wait for it, or one too slow for gait or for what the drives interpolate by."""
    for bus in seen.config.can:
        about = f"[can.{bus}]"
        joints = [place for place in seen.joints() if place.table.bus == bus]
        if not joints:
            continue
        ids = seen.heard_on(bus)
        if ids is None:
            yield Unknown("sync", about, "it was not listened to, or is silent")
            continue
        waiting = [place for place in joints if _waits_for_sync(seen, place)]
        heard = ids.get(0x080)
        if heard is None or heard.count < 2:
            if waiting:
                yield _no_sync(seen, bus, waiting, seen.buses[bus].seconds)
            elif not any(_types(seen, place) for place in joints):
                yield Unknown("sync", about, f"no SYNC was heard; {seen.why_no_objects}")
            continue
        wanted_s = _interpolation_s(seen, joints)
        period_s = 1 / heard.per_s
        if period_s > SLOWEST_SYNC_S or (wanted_s and abs(period_s / wanted_s - 1) > SYNC_TOLERANCE):
            yield _slow_sync(seen, bus, period_s, wanted_s)


def _types(seen: Observations, place: Place) -> list[int]:
    """Transmission types of its enabled TPDOs."""
    found = []
    for number in _TPDOS:
        cob_id, kind = seen.whole(place, 0x1800 + number, 1), seen.whole(place, 0x1800 + number, 2)
        if cob_id is not None and kind is not None and not cob_id & NOT_VALID:
            found.append(kind)
    return found


def _waits_for_sync(seen: Observations, place: Place) -> bool:
    return any(1 <= kind <= 240 for kind in _types(seen, place))


def _producers(seen: Observations, bus: str) -> Iterator[tuple[Place, int]]:
    """Yield the nodes with a SYNC period (1006h), and the period."""
    for place in seen.nodes():
        period = seen.whole(place, 0x1006)
        if place.table.bus == bus and period is not None:
            yield place, period


def _no_sync(seen: Observations, bus: str, waiting: list[Place], seconds: float) -> Finding:
    names = ", ".join(place.name for place in waiting)
    period_s = _interpolation_s(seen, waiting) or 0.01
    producers: list[Fix] = [
        Write(place.name, 0x1006, 0, round(period_s * 1e6), period)
        for place, period in _producers(seen, bus)
        if place.kind == "device" and not period
    ]
    start = Advice(
        "start the bus's master (the gait controller): who sends SYNC is silent, or has lost the bus"
    )
    bench = Advice(
        f'on a bench without one: [gateway] role = "master", [can.{bus}] sync_period_s = {period_s:g}'
    )
    return Finding(
        "sync",
        f"[can.{bus}]",
        "no SYNC comes, and PDOs wait for it: positions are only polled",
        (f"no frame 0x80 in {seconds:.1f} s", f"PDOs on SYNC: {names}"),
        (*producers, start, bench),
    )


def _slow_sync(seen: Observations, bus: str, period_s: float, wanted_s: float | None) -> Finding:
    wanted = wanted_s if wanted_s and wanted_s <= SLOWEST_SYNC_S else 0.01
    evidence = [f"SYNC every {period_s * 1e3:.3g} ms"]
    if wanted_s:
        evidence.append(f"the drives interpolate over {wanted_s * 1e3:.3g} ms (60C2h)")
    writes = [
        Write(place.name, 0x1006, 0, round(wanted * 1e6), period)
        for place, period in _producers(seen, bus)
        if period and place.kind == "device" and period != round(wanted * 1e6)
    ]
    producers = [period for place, period in _producers(seen, bus) if period and place.kind == "device"]
    late = Advice(
        "its master means to send it so often (1006h) and is late: look what keeps it busy (gwrms blame)"
    )
    words = "SYNC does not come as often as PDOs and drives need it"
    master = Advice(f"set the master's SYNC period to {wanted * 1e3:g} ms (1006h in µs)")
    fixes: tuple[Fix, ...] = (*writes, late if producers and not writes else master)
    return Finding("sync", f"[can.{bus}]", words, tuple(evidence), fixes)


def _interpolation_s(seen: Observations, places: list[Place]) -> float | None:
    """Return the interpolation period of most drives (60C2h)."""
    found = []
    for place in places:
        time, exponent = seen.whole(place, 0x60C2, 1), seen.whole(place, 0x60C2, 2)
        if time and exponent is not None:
            found.append(time * 10.0 ** (exponent - 256 if exponent > 127 else exponent))
    return max(set(found), key=found.count) if found else None


def pdo_mapping(seen: Observations) -> Iterator[Verdict]:
    """Position or statusword is in no PDO that comes by itself: it is polled, and late."""
    for place in seen.joints():
        if not any((0x1800 + number, 1) in seen.objects.get(place.name, {}) for number in _TPDOS):
            yield Unknown("pdo_mapping", place.header, seen.why_no_objects)
            continue
        mapped = dict(_mapped(seen, place))
        brought = {index for objects in mapped.values() for index in objects}
        missing = [index for index in _PDO_NAMES if index not in brought]
        if missing:
            yield _unmapped(place, mapped, missing)


def _mapped(seen: Observations, place: Place) -> Iterator[tuple[int, list[int]]]:
    """Each enabled TPDO that comes by itself, and the objects of the joint in it, as of the first axis."""
    for number in _TPDOS:
        cob_id, kind = seen.whole(place, 0x1800 + number, 1), seen.whole(place, 0x1800 + number, 2)
        if cob_id is None or cob_id & NOT_VALID or kind in (252, 253):
            continue
        objects = []
        for subindex in count(1):
            entry = seen.whole(place, 0x1A00 + number, subindex)
            if entry is None or subindex > (seen.whole(place, 0x1A00 + number, 0) or 0):
                break
            objects.append((entry >> 16) - 0x800 * place.axis)
        yield number + 1, objects


def _unmapped(place: Place, mapped: dict[int, list[int]], missing: list[int]) -> Finding:
    names = " and ".join(f"{_PDO_NAMES[index]} ({index:04X}h)" for index in missing)
    evidence = tuple(
        f"TPDO{number} brings {', '.join(f'{index:04X}h' for index in objects) or 'nothing'}"
        for number, objects in mapped.items()
    )
    rate = f"{place.table.poll_hz:g}" if hasattr(place.table, "poll_hz") else "20"
    return Finding(
        "pdo_mapping",
        place.header,
        f"no PDO brings its {names}: asked by SDO {rate} times a second at most",
        evidence or ("no TPDO is enabled",),
        (
            Edit(place.kind, place.name, "configure_pdos", value=True, was=False),
            Advice("map it with the drive's own software: statusword 6041h and position 6064h in one TPDO"),
        ),
    )
