"""Of the drives: encoder and gear, units, mode, limits, and what they do when nobody leads them."""

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from math import hypot, log, sqrt, tau
from statistics import median

from msgspec.structs import replace

from drivers.joint.scaling import TOLERANCE, scalings
from drivers.joint.settings import JointSettings
from gateway.doctor.observations import Observations, Place
from gateway.doctor.verdicts import Edit, Finding, Unknown, Verdict, Write

NOT_WATCHED = 0xFFFF_FFFF
WIDEST_RAD = 1.0  # of a following-error window that still is one
USUAL_WINDOW_RAD = 0.35
MOST_PER_MILLE = 3000  # of the rated current: more is no motor's, or was never set
RATED_PER_MILLE = 1000
CYCLIC_MODES = {
    8: "cyclic synchronous position",
    9: "cyclic synchronous velocity",
    10: "cyclic synchronous torque",
}
MOVES_ON = {0x6007: "its master dies (6007h = 0: no action)", 0x605A: "it is stopped (605Ah = 0: it coasts)"}
SAFER = {0x6007: 3, 0x605A: 2}  # quick stop; down by the quick stop's ramp
RPDO_TARGETS = {0x607A: 8, 0x60FF: 9, 0x6071: 10}
LEAST_SPEED = 0.1  # rad/s on average, on which velocity and position are compared
SLOPE_S = 0.1  # over which the position's change is taken: frames may come in bursts
UNIT_DIFFERS, UNIT_FITS = 3.0, 1.6  # times
_UNITS = ("counts/s", "rpm", "0.1rpm", "0.01rpm", "0.001rpm")


def figures(seen: Observations) -> Iterator[Verdict]:
    """608Fh and 6091h against counts_per_revolution and gear_ratio."""
    for place in seen.joints():
        table = place.table
        if not isinstance(table, JointSettings):
            continue
        pairs = (
            ("counts_per_revolution", table.counts_per_revolution, 0x608F),
            ("gear_ratio", table.gear_ratio, 0x6091),
        )
        for key, ours, index in pairs:
            device = device_ratio(seen, place, index)
            if device is not None and abs(ours - device) > TOLERANCE * max(ours, device):
                yield Finding(
                    "gear",
                    place.header,
                    f"{key} is not what the drive says: angles are wrong by a factor of {device / ours:.3g}",
                    (f"{key} = {ours:g}, {index:04X}h makes {device:g}",),
                    (Edit(place.kind, place.name, key, device, ours),),
                )


def velocity_unit(seen: Observations) -> Iterator[Verdict]:
    """606Ch in another unit than the file says: against how fast the position changes, and by 60A9h."""
    for place in seen.joints():
        table = place.table
        position = seen.column(f"{place.name}.position")
        velocity = seen.column(f"{place.name}.velocity")
        if not isinstance(table, JointSettings) or not _has(seen, place, 0x606C):
            continue
        if position is None or velocity is None or len(position) != len(velocity):
            yield Unknown("velocity_unit", place.header, seen.why_no(f"{place.name}.velocity"))
            continue
        ratio = _speeds_ratio(position, velocity, seen.samples.period_s)
        if ratio is None:
            yield Unknown("velocity_unit", place.header, "the joint did not move: walk, or bend it by hand")
        elif not 1 / UNIT_DIFFERS < ratio < UNIT_DIFFERS:
            yield _wrong_unit(seen, place, table, ratio)


def _wrong_unit(seen: Observations, place: Place, table: JointSettings, ratio: float) -> Verdict:
    """Return the unit that fits best, where one does."""
    now = _per_count(table, table.velocity_unit)

    def misfit(unit: str) -> float:
        return abs(log(ratio * now / _per_count(table, unit)))

    wanted, told = min(_UNITS, key=misfit), seen.whole(place, 0x60A9)
    times = f"its velocity is {1 / ratio:.3g} times what its position changes by"
    if misfit(wanted) > log(UNIT_FITS):
        return Unknown("velocity_unit", place.header, f"{times}, and no unit explains that")
    evidence = (times, *(() if not told else (f"60A9h = 0x{told:08X}",)))
    edit = Edit(place.kind, place.name, "velocity_unit", wanted, table.velocity_unit)
    return Finding(
        "velocity_unit", place.header, f"velocity is not in {table.velocity_unit}", evidence, (edit,)
    )


def _has(seen: Observations, place: Place, index: int) -> bool:
    description = seen.descriptions.get(place.name)
    return description is None or description.has(index + 0x800 * place.axis)


def _per_count(table: JointSettings, unit: str) -> float:
    scaling = scalings(replace(table, velocity_unit=unit), {})["velocity"]
    return abs(scaling.scale) if scaling is not None else 1.0


def _speeds_ratio(position: list[float], velocity: list[float], period_s: float) -> float | None:
    """Return the factor from the velocity to the position's speed; `None` if one of them stands.

    Their sizes are compared, not their courses: a velocity that is only polled now and then is late.
    """
    over = max(1, round(SLOPE_S / period_s))
    slopes = [(b - a) / (over * period_s) for a, b in zip(position, position[over:], strict=False)]
    if not slopes or sum(map(abs, slopes)) / len(slopes) < LEAST_SPEED:
        return None
    slope, speed = (hypot(*values) / sqrt(len(values)) for values in (slopes, velocity))
    return slope / speed if speed > 0 else None


def mode(seen: Observations) -> Iterator[Verdict]:
    """Yield modes of operation that do not fit the RPDOs, or differ from the other joints'."""
    modes = {place.name: seen.whole(place, 0x6061) for place in seen.joints()}
    known = Counter(one for one in modes.values() if one is not None)
    usual = known.most_common(1)[0][0] if known else None
    for place in seen.joints():
        number = modes[place.name]
        if number is None:
            if seen.unanswered(place, 0x6061):
                yield Unknown("mode", place.header, seen.why_no_objects)
            continue
        wanted = _commanded(seen, place) or (usual if usual in CYCLIC_MODES else None)
        if wanted is None or number == wanted:
            continue
        words = f"its mode of operation is {number}, and it is led in mode {wanted} ({CYCLIC_MODES[wanted]})"
        others = sum(one == wanted for one in modes.values())
        evidence = (
            f"6061h = {number}, 6060h = {seen.whole(place, 0x6060)}",
            f"{others} joints are in mode {wanted}",
        )
        yield Finding(
            "mode",
            place.header,
            words,
            evidence,
            (Write(place.name, 0x6060 + 0x800 * place.axis, 0, wanted, number),),
        )


def _commanded(seen: Observations, place: Place) -> int | None:
    """Return the cyclic mode whose target an enabled RPDO brings on SYNC; `None` where none or several do."""
    found = set()
    for number in range(4):
        cob_id, kind = seen.whole(place, 0x1400 + number, 1), seen.whole(place, 0x1400 + number, 2)
        if cob_id is None or cob_id & 0x8000_0000 or kind is None or kind > 240:
            continue
        for subindex in range(1, (seen.whole(place, 0x1600 + number, 0) or 0) + 1):
            entry = seen.whole(place, 0x1600 + number, subindex)
            target = None if entry is None else RPDO_TARGETS.get((entry >> 16) - 0x800 * place.axis)
            found |= {target} if target is not None else set()
    return found.pop() if len(found) == 1 else None


def current_limit(seen: Observations) -> Iterator[Verdict]:
    """6073h unset, or more than the motor has; the file's rated current against 6075h."""
    for place in seen.joints():
        limit, rated_ma = seen.whole(place, 0x6073), seen.whole(place, 0x6075)
        if seen.unanswered(place, 0x6073):
            yield Unknown("current_limit", place.header, seen.why_no_objects)
        elif limit is not None and not 0 < limit <= MOST_PER_MILLE:
            wanted = _usual(seen, partial(_whole, seen, 0x6073), 1, MOST_PER_MILLE) or RATED_PER_MILLE
            words = (
                "its current limit was never set"
                if limit in (0, 0xFFFF)
                else "its current limit is above its motor's"
            )
            amps = (
                ""
                if not rated_ma
                else f": {limit * rated_ma / 1e6:.0f} A for a motor of {rated_ma / 1e3:g} A"
            )
            evidence = (f"6073h = {limit} ‰ of its rated current{amps}",)
            write = Write(place.name, 0x6073 + 0x800 * place.axis, 0, wanted, limit)
            yield Finding("current_limit", place.header, words, evidence, (write,))


def following_window(seen: Observations) -> Iterator[Verdict]:
    """6065h that never trips."""
    for place in seen.joints():
        window = seen.whole(place, 0x6065)
        if seen.unanswered(place, 0x6065):
            yield Unknown("following_window", place.header, seen.why_no_objects)
            continue
        per_count = _rad_per_count(seen, place)
        if window is None or (window != NOT_WATCHED and window * per_count <= WIDEST_RAD):
            continue
        most = int(WIDEST_RAD / per_count)
        wanted = _usual(seen, partial(_whole, seen, 0x6065), 1, most) or round(USUAL_WINDOW_RAD / per_count)
        words = "its following error is not watched: a joint that is blocked, or runs away, is never noticed"
        size = "off" if window == NOT_WATCHED else f"{window * per_count:.3g} rad"
        write = Write(place.name, 0x6065 + 0x800 * place.axis, 0, wanted, window)
        yield Finding("following_window", place.header, words, (f"6065h = {window} ({size})",), (write,))


def reaction(seen: Observations) -> Iterator[Verdict]:
    """Yield drives that keep moving when their master dies, or when they are stopped."""
    for place in seen.joints():
        if any(seen.unanswered(place, index) for index in MOVES_ON):
            yield Unknown("reaction", place.header, seen.why_no_objects)
        for index, words in MOVES_ON.items():
            if seen.whole(place, index) != 0:
                continue
            wanted = _usual(seen, partial(_whole, seen, index), 1, 3) or SAFER[index]
            write = Write(place.name, index + 0x800 * place.axis, 0, wanted, 0)
            yield Finding(
                "reaction", place.header, f"nothing holds it when {words}", (f"{index:04X}h = 0",), (write,)
            )


def _rad_per_count(seen: Observations, place: Place) -> float:
    """Return it at the joint: by what the drive knows of encoder and gear, else by the file."""
    table = place.table
    if not isinstance(table, JointSettings):
        return 1.0
    counts = device_ratio(seen, place, 0x608F) or table.counts_per_revolution
    return tau / (counts * (device_ratio(seen, place, 0x6091) or table.gear_ratio))


def device_ratio(seen: Observations, place: Place, index: int) -> float | None:
    """Sub-index 1 over 2; 1:1 is what drives hold that were never told."""
    above, below = seen.whole(place, index, 1), seen.whole(place, index, 2)
    return above / below if above and below and above != below else None


def _whole(seen: Observations, index: int, place: Place) -> int | None:
    return seen.whole(place, index)


def _usual(seen: Observations, value: Callable[[Place], int | None], least: int, most: int) -> int | None:
    """Return the other joints' median of a setting, within plausible bounds."""
    found = [one for place in seen.joints() if (one := value(place)) is not None and least <= one <= most]
    return int(median(found)) if found else None
