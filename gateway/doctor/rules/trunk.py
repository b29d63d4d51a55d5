"""Of the trunk's IMU: whether its values change at all, which axis is up, and which is left."""

from collections.abc import Iterator
from statistics import fmean

from gateway.doctor.gait import HOW, NORMAL, SIDES, Gait, correlation, gait, swapped_kinds
from gateway.doctor.observations import Observations
from gateway.doctor.verdicts import Advice, Edit, Finding, Unknown, Verdict

GRAVITY = 9.81
UPRIGHT = 0.75  # of gravity that the axis must feel which is up
LEAST_SECONDS = 2.0
SIDEWAYS = 0.5  # correlation of the acceleration to a side with the load of the feet
_AXES = ("x", "y", "z")
Signed = tuple[int, int]  # which axis, and its sign


def imu(seen: Observations) -> Iterator[Verdict]:
    """Frozen, or mounted otherwise than the file says."""
    if not seen.config.imu:
        yield Unknown("imu", "IMUs", "the robot has none")
    for name in seen.config.imu:
        about = f"[imu.{name}]"
        columns = [seen.column(f"{name}.acceleration_{axis}") for axis in _AXES]
        problem = seen.samples.problems.get(name)
        if problem is not None and "again and again" in problem:
            yield _frozen(about, problem)
        elif any(column is None for column in columns):
            yield Unknown("imu", about, seen.why_no(f"{name}.acceleration_x"))
        else:
            yield from _judged(seen, name, [column for column in columns if column is not None])


def _frozen(about: str, evidence: str) -> Finding:
    restart = Advice("restart it: unplug it and plug it in again; then look at its cable and supply")
    return Finding(
        "imu", about, "it is frozen: it sends the same values again and again", (evidence,), (restart,)
    )


def _judged(seen: Observations, name: str, columns: list[list[float]]) -> Iterator[Verdict]:
    about = f"[imu.{name}]"
    if seen.samples.seconds < LEAST_SECONDS:
        yield Unknown("imu", about, "it was watched for too short a time")
        return
    if all(len(set(column)) == 1 for column in columns):
        yield _frozen(about, f"not one value changed in {seen.samples.seconds:.0f} s")
        return
    means = [fmean(column) for column in columns]
    up = _largest(means)
    if abs(means[up[0]]) < UPRIGHT * GRAVITY:
        yield Unknown("imu", about, "no axis points up or down: its wearer leans, or mounting is missing")
        return
    left = _left(seen, columns, up)
    if left is None and up == (2, 1):
        yield Unknown(
            "imu", about, f"up is right; which way is forward was not seen: {HOW}, with both insoles"
        )
    elif left is None:
        yield _turned(seen, name, up, (1, 1) if up[0] != 1 else (0, 1), means, sure=False)
    elif (up, left) != ((2, 1), (1, 1)):
        yield _turned(seen, name, up, left, means, sure=True)


def _largest(values: list[float]) -> Signed:
    index = max(range(len(values)), key=lambda at: abs(values[at]))
    return index, 1 if values[index] > 0 else -1


def _left(seen: Observations, columns: list[list[float]], up: Signed) -> Signed | None:
    """Return the axis to the left: the body leans to the right while the left foot carries it."""
    found = gait(seen)
    if isinstance(found, str) or any(len(column) != len(found.load) for column in columns):
        return None
    turned = -1 if _insoles_are_swapped(found) else 1
    likes = [
        turned * correlation(column, found.load) if at != up[0] else 0.0 for at, column in enumerate(columns)
    ]
    index, sign = _largest(likes)
    return (index, -sign) if abs(likes[index]) > SIDEWAYS else None


def _insoles_are_swapped(found: Gait) -> bool:
    kinds = {kind for kind in NORMAL if any((kind, side) in found.matches for side in SIDES)}
    return len(kinds) >= 2 and set(swapped_kinds(found)) == kinds


def _turned(
    seen: Observations, name: str, up: Signed, left: Signed, means: list[float], *, sure: bool
) -> Finding:
    settings = seen.config.imu[name]
    now = settings.axes or _AXES
    wanted = [_axis(now, one) for one in (_cross(left, up), left, up)]
    felt = ", ".join(f"{axis} {mean:.1f}" for axis, mean in zip(_AXES, means, strict=True))
    evidence = [f"on average it feels {felt} m/s², where gravity is z 9.8"]
    if sure:
        evidence.append(
            f"to the side it sways along {'-' if left[1] < 0 else ''}{_AXES[left[0]]}, where y is left"
        )
    fixes = [Edit("imu", name, "axes", wanted, None if settings.axes is None else list(settings.axes))]
    postures = Advice("which way is forward was not seen: walk for 20 s and ask again")
    words = "its axes are not as the file says: what it calls z is not up, or y not left"
    return Finding("imu", f"[imu.{name}]", words, tuple(evidence), (*fixes, *(() if sure else (postures,))))


def _cross(left: Signed, up: Signed) -> Signed:
    """Forward: left times up."""
    index = 3 - left[0] - up[0]
    even = (left[0], up[0]) in {(0, 1), (1, 2), (2, 0)}
    return index, left[1] * up[1] * (1 if even else -1)


def _axis(now: tuple[str, ...], one: Signed) -> str:
    axis = now[one[0]]
    return axis if one[1] > 0 else axis.removeprefix("-") if axis.startswith("-") else f"-{axis}"
