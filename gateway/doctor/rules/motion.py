"""Of the motion: scale, sign, zero, what is left and right; by the other leg and by how people walk."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import fmean, median

from drivers.joint.settings import JointSettings
from gateway.doctor.gait import (
    HOW,
    LIKE,
    NORMAL,
    SIDES,
    Gait,
    force,
    gait,
    insole_of,
    is_flipped,
    joint_of,
    normal_mean,
    normal_span,
    other,
    span,
    swapped_kinds,
)
from gateway.doctor.observations import Observations, Place
from gateway.doctor.rules.drive import device_ratio, figures
from gateway.doctor.verdicts import Advice, Edit, Finding, Fix, Together, Unknown, Verdict

SCALE_DIFFERS = 1.6  # times, between the ranges of left and right
ZERO_DIFFERS = 0.15  # rad, between the means of left and right
LEAST_SPAN = 0.1  # rad, of a joint that walks
MOVES = 0.4  # of the normal range: the leg's joints that tell that somebody walks
SIMPLE = (0.1, 0.2, 0.25, 1 / 3, 0.5, 2.0, 3.0, 4.0, 5.0, 10.0)  # factors by which people are wrong
SIMPLE_WITHIN = 0.15
MOST_INSOLE_N, LEAST_INSOLE_N = 4000.0, 150.0  # the most under one foot of somebody who walks
USUAL_INSOLE_N = 900.0
FEET_DIFFER = 2.0
ALONE = "no other leg has such a joint: names as in left_knee and right_knee pair them"


@dataclass(frozen=True, slots=True)
class Pair:
    """One joint of both legs, as it moved."""

    kind: str
    left: list[float]
    right: list[float]

    def of(self, side: str) -> list[float]:
        return self.left if side == "left" else self.right


def _pairs(seen: Observations) -> Iterator[Pair | str]:
    """Yield each joint that both legs have; a reason in words where it cannot be judged."""
    for kind in NORMAL:
        names = [joint_of(side, kind) for side in SIDES]
        if any(name not in seen.config.joint for name in names):
            continue
        left, right = (seen.column(f"{name}.position") for name in names)
        if left is None or right is None:
            yield kind
        else:
            yield Pair(kind, left, right)


def _single(seen: Observations) -> Iterator[Place]:
    """Yield joints that no name pairs with one of the other leg."""
    paired = {joint_of(side, kind) for kind in NORMAL for side in SIDES}
    for place in seen.joints():
        twin = place.name.replace("left_", "right_") if place.name.startswith("left_") else ""
        twin = twin or place.name.replace("right_", "left_")
        if place.name not in paired or twin not in seen.config.joint:
            yield place


def _walks(seen: Observations, pairs: list[Pair | str]) -> bool:
    """Return whether the legs swing: two joints at least move as far as in walking."""
    moving = [
        one
        for pair in pairs
        if isinstance(pair, Pair)
        for one in (pair.left, pair.right)
        if span(one) > max(LEAST_SPAN, MOVES * normal_span(pair.kind))
    ]
    return len(moving) >= 2 and not isinstance(gait(seen), str) if seen.config.insole else len(moving) >= 2


def _place(seen: Observations, side: str, kind: str) -> Place:
    name = joint_of(side, kind)
    return Place("joint", name, seen.config.joint[name])


def _unjudged(seen: Observations, rule: str, kind: str) -> Unknown:
    channels = [f"{joint_of(side, kind)}.position" for side in SIDES]
    missing = next(one for one in channels if seen.column(one) is None)
    return Unknown(rule, f"{kind}s", seen.why_no(missing))


def gear(seen: Observations) -> Iterator[Verdict]:
    """Yield counts and ratio: as the drive says, and by how far left and right go."""
    told = list(figures(seen))
    yield from told
    wrong = {finding.about for finding in told if isinstance(finding, Finding)}
    for place in _single(seen):
        if device_ratio(seen, place, 0x6091) is None:
            yield Unknown("gear", place.header, ALONE)
    pairs = list(_pairs(seen))
    walks = _walks(seen, pairs)
    for pair in pairs:
        if isinstance(pair, str):
            yield _unjudged(seen, "gear", pair)
            continue
        spans = {side: span(pair.of(side)) for side in SIDES}
        places = {side: _place(seen, side, pair.kind) for side in SIDES}
        if not walks or min(spans.values()) < LEAST_SPAN / 10:
            yield Unknown("gear", f"{pair.kind}s", HOW)
        elif max(spans.values()) / min(spans.values()) > SCALE_DIFFERS and wrong.isdisjoint(
            place.header for place in places.values()
        ):
            if all(device_ratio(seen, place, 0x6091) for place in places.values()):
                yield Unknown("gear", f"{pair.kind}s", _one_sided(spans))
                continue
            yield _scale(pair.kind, spans, places, _stride(pairs, pair.kind))


def _one_sided(spans: dict[str, float]) -> str:
    left, right = (math.degrees(spans[side]) for side in SIDES)
    return (
        f"left goes {left:.0f}°, right {right:.0f}°, though the drives have the file's figures: it is how "
        "the wearer walks, or a drive was told a wrong gear"
    )


def _stride(pairs: list[Pair | str], but: str) -> float:
    """Return the stride as a share of the usual one, by the range of the other joints."""
    others = [pair for pair in pairs if isinstance(pair, Pair) and pair.kind != but]
    shares = [span(pair.of(side)) / normal_span(pair.kind) for pair in others for side in SIDES]
    return median(shares) if shares else 1.0


def _scale(kind: str, spans: dict[str, float], places: dict[str, Place], stride: float) -> Finding:
    """Return the side that is farther from how people walk is the wrong one."""
    usual = stride * normal_span(kind)
    wrong = max(SIDES, key=lambda side: abs(math.log(spans[side] / usual)))
    place, factor = places[wrong], _simple(spans[wrong] / spans[other(wrong)])
    evidence = tuple(f"{places[side].name} goes {math.degrees(spans[side]):.0f}°" for side in SIDES)
    fixes: list[Fix] = []
    for side, by in ((wrong, factor), (other(wrong), 1 / factor)):
        table = places[side].table
        if isinstance(table, JointSettings):
            value = float(f"{table.gear_ratio * by:.4g}")
            fixes.append(Edit("joint", places[side].name, "gear_ratio", value, table.gear_ratio))
    words = f"it goes {factor:.3g} times as far as {places[other(wrong)].name}: counts or gear ratio are off"
    return Finding("gear", place.header, words, evidence, tuple(fixes))


def _simple(factor: float) -> float:
    near = min(SIMPLE, key=lambda one: abs(math.log(one / factor)))
    return near if abs(near / factor - 1) < SIMPLE_WITHIN else factor


def sign(seen: Observations) -> Iterator[Verdict]:
    """Yield a joint that bends where it should stretch."""
    found = gait(seen)
    if isinstance(found, str):
        yield Unknown("sign", "joints", found)
        return
    yield from _unseen(seen, "sign", found)
    swapped = swapped_kinds(found)
    for (kind, side), match in found.matches.items():
        place = _place(seen, side, kind)
        if kind in swapped:
            continue
        if is_flipped(match):
            direction = getattr(place.table, "direction", 1)
            evidence = (
                f"its curve over the stride is {-100 * match.own:.0f} % the mirror image of normal gait",
            )
            edit = Edit("joint", place.name, "direction", -direction, direction)
            yield Finding(
                "sign",
                place.header,
                "its sign is flipped: it counts bending as stretching",
                evidence,
                (edit,),
            )
        elif match.own < LIKE:
            yield Unknown("sign", place.header, f"it does not move as in level walking: {HOW}")


def _unseen(seen: Observations, rule: str, found: Gait) -> Iterator[Unknown]:
    """Yield joints of which nothing was seen, or whose names say no side."""
    known = {joint_of(side, kind): (kind, side) for kind in NORMAL for side in SIDES}
    for place in seen.joints():
        if known.get(place.name) not in found.matches:
            why = seen.why_no(f"{place.name}.position")
            yield Unknown(rule, place.header, why if place.name in known else ALONE)


def sides(seen: Observations) -> Iterator[Verdict]:
    """Left taken for right: of one kind of joint, or of the insoles."""
    found = gait(seen)
    if isinstance(found, str):
        yield Unknown("sides", "left and right", found)
        return
    yield from _unseen(seen, "sides", found)
    swapped = swapped_kinds(found)
    known = {kind for kind, _ in found.matches}
    if len(swapped) >= 2 and len(swapped) == len(known):
        yield _swapped_insoles(seen, found, swapped)
        return
    for kind in swapped:
        places = [_place(seen, side, kind) for side in SIDES]
        edits = tuple(
            Edit("joint", place.name, key, getattr(source.table, key), getattr(place.table, key))
            for place, source in (places, places[::-1])
            for key in ("bus", "node_id", "axis")
            if getattr(source.table, key) != getattr(place.table, key)
        )
        about = " and ".join(place.name for place in places)
        words = f"left and right {kind} are swapped: each moves with the other leg's foot"
        yield Finding("sides", about, words, tuple(_halves(found, kind)), (Together(edits),))


def _halves(found: Gait, kind: str) -> Iterator[str]:
    for side in SIDES:
        match = found.matches[kind, side]
        yield (
            f"{joint_of(side, kind)}: like normal gait by {100 * match.own:.0f} %, "
            f"half a stride later by {100 * match.half:.0f} %"
        )


def _swapped_insoles(seen: Observations, found: Gait, swapped: list[str]) -> Finding:
    names = [insole_of(seen, side) or side for side in SIDES]
    tables = [seen.config.insole[name] for name in names]
    edits = tuple(
        Edit("insole", name, "port", tables[1 - number].port, tables[number].port)
        for number, name in enumerate(names)
        if tables[0].port != tables[1].port
    )
    ports = (Together(edits),) if edits else ()
    joints = Advice("every joint of both legs is swapped: then exchange their node ids")
    shoes = Advice("they lie in the wrong shoes: exchange them")
    evidence = tuple(text for kind in swapped for text in _halves(found, kind))
    words = "left and right insole are swapped: every joint swings while its own foot stands"
    return Finding("sides", " and ".join(names), words, evidence, (*ports, shoes, joints))


def zero(seen: Observations) -> Iterator[Verdict]:
    """Yield a joint whose middle is not where the other leg's is."""
    found = gait(seen)
    flipped = (
        set() if isinstance(found, str) else {key for key, one in found.matches.items() if is_flipped(one)}
    )
    swapped = [] if isinstance(found, str) else swapped_kinds(found)
    yield from (Unknown("zero", place.header, ALONE) for place in _single(seen))
    pairs = list(_pairs(seen))
    walks = _walks(seen, pairs)
    scaled = {verdict.about for verdict in figures(seen)}
    for pair in pairs:
        if isinstance(pair, str):
            yield _unjudged(seen, "zero", pair)
            continue
        if not scaled.isdisjoint(_place(seen, side, pair.kind).header for side in SIDES):
            yield Unknown("zero", f"{pair.kind}s", "counts or gear ratio are off: fix that first")
            continue
        spans = [span(pair.of(side)) for side in SIDES]
        means = {side: fmean(pair.of(side)) for side in SIDES}
        if not walks or min(spans) < LEAST_SPAN or max(spans) / min(spans) > SCALE_DIFFERS:
            yield Unknown(
                "zero",
                f"{pair.kind}s",
                HOW if not walks else "left and right move differently: fix that first",
            )
        elif any((pair.kind, side) in flipped for side in SIDES) and pair.kind not in swapped:
            yield Unknown("zero", f"{pair.kind}s", "a sign is flipped: fix that first")
        elif abs(means["left"] - means["right"]) > ZERO_DIFFERS:
            yield _off(seen, pair.kind, means)


def _off(seen: Observations, kind: str, means: dict[str, float]) -> Finding:
    wrong = max(SIDES, key=lambda side: abs(means[side] - normal_mean(kind)))
    edits = []
    for side in (wrong, other(wrong)):
        place = _place(seen, side, kind)
        before = getattr(place.table, "zero_offset", 0.0)
        value = round(before + means[other(side)] - means[side], 3)
        edits.append(Edit("joint", place.name, "zero_offset", value, before))
    off = math.degrees(means[wrong] - means[other(wrong)])
    evidence = tuple(
        f"{joint_of(side, kind)} is at {math.degrees(means[side]):.0f}° on average" for side in SIDES
    )
    words = f"its zero is off by about {off:.0f}°, by the other leg"
    return Finding("zero", _place(seen, wrong, kind).header, words, evidence, (edits[0], edits[1]))


def insole_scale(seen: Observations) -> Iterator[Verdict]:
    """Yield a foot that carries what no foot does, or many times what the other one carries."""
    most: dict[str, float] = {}
    if not seen.config.insole:
        yield Unknown("insole_scale", "insoles", "the robot has none")
    for side in SIDES:
        insole, values = insole_of(seen, side), force(seen, side)
        if insole is not None and values is None:
            yield Unknown("insole_scale", f"[insole.{insole}]", seen.why_no(f"{insole}.force"))
        elif values is not None:
            most[side] = sorted(values)[int(0.98 * (len(values) - 1))]
    walks = _walks(seen, list(_pairs(seen))) or not seen.config.joint
    if most and not walks:
        yield Unknown("insole_scale", "insoles", HOW)
        return
    for side, value in most.items():
        against = most.get(other(side))
        outside = not LEAST_INSOLE_N <= value <= MOST_INSOLE_N
        differs = against is not None and _ratio(value, against) > FEET_DIFFER and _farther(value, against)
        if outside or differs:
            yield _scaled(seen, side, value, against)


def _ratio(one: float, two: float) -> float:
    return max(one, two) / max(min(one, two), 1e-3)


def _farther(one: float, two: float) -> bool:
    return _ratio(one, USUAL_INSOLE_N) > _ratio(two, USUAL_INSOLE_N)


def _scaled(seen: Observations, side: str, value: float, against: float | None) -> Finding:
    insole = insole_of(seen, side) or side
    table = seen.config.insole[insole]
    right = against if against is not None and LEAST_INSOLE_N <= against <= MOST_INSOLE_N else USUAL_INSOLE_N
    factor = _simple(right / value) if value > 0 else 0.0
    evidence = [f"at most {value:.0f} N under it in walking"]
    evidence += [] if against is None else [f"{against:.0f} N under the other foot"]
    calibrate = Advice(
        f"gwrms calibrate insole anew, with a known weight: calibration = … in [insole.{insole}]"
    )
    file = table.calibration or f"the calibration that [insole.{insole}] names"
    gain = Advice(f"{file}: multiply every gain by {factor:.3g}")
    fixes = (gain, calibrate) if factor else (calibrate,)
    words = f"its scale is off, by about {1 / factor:.3g}" if factor else "it feels nothing"
    return Finding("insole_scale", f"[insole.{insole}]", words, tuple(evidence), fixes)
