"""What keeps a value from a device: every row of its tables holds, and every mutant of the code breaks one.

Each `check_…` holds a module's part of the rules against a table made by hand, and is run on the sound module
and on every mutant of it.
"""

import ast
import inspect
import itertools
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from drivers.joint.cia402 import DriveState
from gateway import coding
from gateway.config.robot import ParameterSettings
from gateway.modules.control import catalogue, eds_parameters, parameters, rules
from gateway.modules.control.parameters import Lock, Parameter
from gateway.wire.framing import ErrorKind, RpcError
from tests.mutation.operators import mutants
from tests.mutation.operators import names as names_in

UNSIGNED8, INTEGER8, UNSIGNED64, BOOLEAN, REAL32, REAL64 = 0x05, 0x02, 0x1B, 0x01, 0x08, 0x11


def refused(do: Callable[[], object]) -> ErrorKind | None:
    """The kind of refusal; `None` where it was done."""
    try:
        do()
    except RpcError as error:
        return error.kind
    return None


# Access and limits of one parameter

ACCESS = {
    "rw": (None, None),
    "rwr": (None, None),
    "rww": (None, None),
    "ro": (None, ErrorKind.READ_ONLY),
    "const": (None, ErrorKind.READ_ONLY),
    "wo": (ErrorKind.NOT_ALLOWED, ErrorKind.NOT_ALLOWED),
    "": (ErrorKind.NOT_ALLOWED, ErrorKind.NOT_ALLOWED),
}  # access in the EDS → reading, writing
LIMITS = [
    (None, None, -128, None),
    (None, None, 127, None),
    (None, None, -129, ErrorKind.OUT_OF_LIMIT),
    (None, None, 128, ErrorKind.OUT_OF_LIMIT),
    (10, 20, 9, ErrorKind.OUT_OF_LIMIT),
    (10, 20, 10, None),
    (10, 20, 15, None),
    (10, 20, 20, None),
    (10, 20, 21, ErrorKind.OUT_OF_LIMIT),
    (10, None, 9, ErrorKind.OUT_OF_LIMIT),
    (10, None, 10, None),
    (10, None, 21, None),
    (None, 20, 9, None),
    (None, 20, 20, None),
    (None, 20, 21, ErrorKind.OUT_OF_LIMIT),
    (0, 0, 0, None),
    (0, 0, 1, ErrorKind.OUT_OF_LIMIT),
    (0, 0, -1, ErrorKind.OUT_OF_LIMIT),
    (9.6, 20, 9.6, None),  # the device would hold 10
    (9.2, 20, 9.2, ErrorKind.OUT_OF_LIMIT),  # the device would hold 9
    (10, 19.8, 19.8, ErrorKind.OUT_OF_LIMIT),  # the device would hold 20
]  # min, max, value, what comes of it
ACCEPTED = [
    (b"\x05", None),
    (b"\xfb", None),
    (b"\x06", ErrorKind.OUT_OF_LIMIT),
    (b"\xfa", ErrorKind.OUT_OF_LIMIT),
    (b"", ErrorKind.MISMATCH),
    (b"\x05\x00", ErrorKind.MISMATCH),
]  # bytes within −5 and 5, what comes of them
CONTRADICTIONS: list[tuple[float | None, float | None, bool]] = [
    (None, None, False),
    (1, None, False),
    (None, 1, False),
    (1, 1, False),
    (-0.5, 0.5, False),
    (2, 1, True),
    (0.5, -0.5, True),
]  # minimum, maximum, whether they contradict each other
REAL_LIMITS = [
    (REAL32, 1.0, None, 0.6, 0.6, None),  # the device holds 0.60000002
    (REAL32, 1.0, None, 0.6, 0.60000003, None),  # and so it does of this
    (REAL32, 1.0, None, 0.6, 0.6000001, ErrorKind.OUT_OF_LIMIT),
    (REAL32, 1.0, 0.7, None, 0.7, None),  # 0.69999999
    (REAL32, 1.0, 0.7, None, 0.6999999, ErrorKind.OUT_OF_LIMIT),
    (REAL32, 0.001, -0.6, 0.6, 0.6, None),
    (REAL32, 0.001, -0.6, 0.6, -0.6, None),
    (REAL32, -0.001, -0.6, 0.6, 0.6, None),
    (REAL32, 1.0, -1e300, 1e300, 5.0, None),  # no REAL32 reaches them
    (REAL64, 0.001, None, 0.6, 0.6, None),  # 0.6000000000000001
    (REAL64, 1.0, None, 0.6, 0.6000000000000001, ErrorKind.OUT_OF_LIMIT),
    (INTEGER8, 0.25, None, 0.7, 0.7, ErrorKind.OUT_OF_LIMIT),  # the device would hold 0.75
    (INTEGER8, 0.1, None, 0.6, 0.6, None),
    (INTEGER8, 0.1, None, 0.6, 0.64, ErrorKind.OUT_OF_LIMIT),
]  # type, scale, min, max, value, what comes of it


def check_parameter(module: ModuleType) -> None:
    def one(**given: Any) -> Any:
        settings = ParameterSettings(object="0x2000:0")
        known = {"data_type": INTEGER8, "access": "rw"} | given
        return module.Parameter("knee.x", "knee", settings, 0x2000, 0, **known)

    for access, (reading, writing) in ACCESS.items():
        found = one(access=access)
        assert refused(found.check_readable) == reading
        assert refused(found.check_writable) == writing
        assert refused(lambda found=found: found.encode(1)) == writing  # type: ignore[misc]
        word = None if access in ("rw", "rwr", "rww") else f"{access} in the EDS"
        assert (found.read_only, one(access=access, problem="broken").read_only) == (word, None)
    for low, high, value, kind in LIMITS:
        limited = one(min=low, max=high)
        assert refused(lambda limited=limited, value=value: limited.encode(value)) == kind  # type: ignore[misc]
    for least, most, expected in CONTRADICTIONS:
        assert (module.contradiction(least, most, "drive.eds") is not None) is expected
    for data_type, scale, least, most, value, kind in REAL_LIMITS:
        settings = ParameterSettings(object="0x2000:0", scale=scale)
        real = module.Parameter("knee.x", "knee", settings, 0x2000, 0, data_type, "rw", least, most)
        assert refused(lambda real=real, value=value: real.encode(value)) == kind  # type: ignore[misc]
    for lock in module.Lock:
        locked = one(lock=lock, table="[joint.knee]")
        assert (refused(locked.check_readable), locked.read_only) == (None, lock.value)
        assert refused(lambda locked=locked: locked.encode(1)) == ErrorKind.READ_ONLY  # type: ignore[misc]
    broken = one(problem="no such object")
    assert {refused(broken.check_readable), refused(lambda: broken.encode(1))} == {ErrorKind.UNAVAILABLE}
    assert one().encode(5) == b"\x05"
    for data, kind in ACCEPTED:
        limited = one(min=-5, max=5)
        assert refused(lambda limited=limited, data=data: limited.accepts(data)) == kind  # type: ignore[misc]
    assert one().accepts(b"\xff") == -1
    assert refused(lambda: one(access="ro").accepts(b"\x01")) == ErrorKind.READ_ONLY


# Numbers and bytes

ENCODED: list[tuple[int, float, float, bytes | None]] = [
    (UNSIGNED8, 1.0, 0, b"\x00"),
    (UNSIGNED8, 1.0, 255, b"\xff"),
    (UNSIGNED8, 1.0, 256, None),
    (UNSIGNED8, 1.0, -1, None),
    (INTEGER8, 1.0, -128, b"\x80"),
    (INTEGER8, 1.0, -129, None),
    (UNSIGNED8, 0.1, 0.3, b"\x03"),
    (UNSIGNED8, 0.1, 0.25, b"\x02"),  # half to even
    (UNSIGNED8, 0.1, 0.35, b"\x04"),
    (UNSIGNED8, 10.0, 250, b"\x19"),
    (UNSIGNED64, 1.0, 2**64 - 1, b"\xff" * 8),
    (UNSIGNED64, 1.0, float(2**52 - 1), (2**52 - 1).to_bytes(8, "little")),
    (UNSIGNED64, 1.0, float(2**52), None),
    (UNSIGNED64, 1.0, 2**52, (2**52).to_bytes(8, "little")),
    (BOOLEAN, 1.0, 0, b"\x00"),
    (BOOLEAN, 1.0, 1, b"\x01"),
    (BOOLEAN, 1.0, 2, None),
    (BOOLEAN, 1.0, -1, None),
    (REAL32, 2.0, 1.0, b"\x00\x00\x00\x3f"),
    (REAL32, 1.0, 1e39, None),
    (REAL64, 0.5, 1.0, b"\0\0\0\0\0\0\0\x40"),
    (REAL64, 1e-300, 1e300, None),
]  # type, scale, value, bytes
DECODED: list[tuple[int, float, bytes, float | None]] = [
    (UNSIGNED8, 1.0, b"\xff", 255),
    (INTEGER8, 1.0, b"\xff", -1),
    (UNSIGNED8, 0.1, b"\x03", 0.3),
    (UNSIGNED8, 10.0, b"\x19", 250),
    (UNSIGNED64, 0.5, (2**52 - 1).to_bytes(8, "little"), (2**52 - 1) / 2),
    (UNSIGNED64, 0.5, (2**52).to_bytes(8, "little"), None),
    (UNSIGNED64, 1.0, b"\xff" * 8, 2**64 - 1),
    (UNSIGNED64, 3.0, b"\xff" * 8, 3 * (2**64 - 1)),
    (BOOLEAN, 1.0, b"\x01", 1),
    (BOOLEAN, 1.0, b"\x02", None),
    (UNSIGNED8, 1.0, b"\x02", 2),
    (UNSIGNED8, 1.0, b"", None),
    (REAL32, 2.0, b"\x00\x00\x00\x3f", 1.0),
    (REAL32, 1.0, b"\x00\x00\xc0\x7f", None),
    (REAL64, 1e300, b"\xff\xff\xff\xff\xff\xff\xef\x7f", None),
    (0x09, 1.0, b"text", None),
]  # type, scale, bytes, value
NEAREST: list[tuple[int, float, float, float]] = [
    (REAL32, 1.0, 0.6, 0.6000000238418579),
    (REAL32, 1.0, 0.5, 0.5),
    (REAL32, 1.0, 1e39, 1e39),
    (REAL64, 1.0, 0.6, 0.6),
    (INTEGER8, 0.25, 0.7, 0.7),
]  # type, scale, limit, as the device can hold it
STEPS = [
    (1.0, 1.5, 0.5, False),
    (1.5, 1.0, 0.5, False),
    (0.4, 0.5, 0.1, False),  # 0.09999999999999998
    (0.2, 0.3, 0.1, False),  # 0.09999999999999998
    (0.3, 0.4, 0.1, False),  # 0.10000000000000003: binary, not more
    (1.0, 1.500001, 0.5, True),
    (1.0, 0.499999, 0.5, True),
    (0, 5, 5.0, False),
    (0, 6, 5.0, True),
    (-3, 3, 5.0, True),
    (3, 3, 5.0, False),
    (0, 1 + 1e-9, 1.0, False),  # as far as binary may be wrong
]  # before, after, most, too far


LIMITED = SimpleNamespace(min=-0.7, max=0.6, max_step=0.5)
BROKEN: list[tuple[int | None, float, float | None, str | None]] = [
    (None, 0.6, None, None),
    (None, 0.60000002, None, "max"),
    (REAL32, 0.60000002, None, None),  # which the device holds of 0.6
    (REAL32, 0.6000001, None, "max"),
    (None, -0.7, None, None),
    (None, -0.70000001, None, "min"),
    (REAL32, -0.70000001, None, "min"),
    (REAL32, -0.69999998, None, None),
    (None, 0.6, 0.1, None),
    (None, 0.6, 0.0, "max_step"),
    (None, 0.7, 0.0, "max"),
    (None, -0.8, 0.0, "min"),
]  # the type, the value, the one before, and the limit that is broken


def check_coding(module: ModuleType) -> None:
    for data_type, scale, value, data in ENCODED:
        assert _coded(module, lambda: module.Coding(data_type, scale).encode(value)) == data  # noqa: B023
    for data_type, scale, data, expected in DECODED:
        found = _coded(module, lambda: module.Coding(data_type, scale).decode(data))  # noqa: B023
        assert (found, type(found)) == (expected, type(expected))
    for data_type, scale, limit, expected in NEAREST:
        assert module.Coding(data_type, scale).nearest(limit) == expected
    for before, after, most, too_far in STEPS:
        limited = SimpleNamespace(min=None, max=None, max_step=most)
        assert (module.broken_limit(limited, None, after, before) == "max_step") is too_far
    for kind, reached, was, broken in BROKEN:
        held = None if kind is None else module.Coding(kind)
        assert module.broken_limit(LIMITED, held, reached, was) == broken
    assert module.coding_of("REAL32", 0.1) == module.Coding(REAL32, 0.1)
    assert module.coding_of("", 1.0) is None


def _coded(module: ModuleType, do: Callable[[], Any]) -> Any:
    try:
        return do()
    except module.CodingError:
        return None


# Whose limits count

STRICTER = [
    (None, None, 1.0, 0, 2500),
    (0, 3000, 1.0, 0, 2500),
    (100, 2000, 1.0, 100, 2000),
    (100, 3000, 1.0, 100, 2500),
    (None, 2000, 1.0, 0, 2000),
    (None, None, 0.1, 0.0, 250.0),
    (None, None, -1.0, -2500, 0),
    (-3000, -1000, -1.0, -2500, -1000),
    (-2000, 500, -1.0, -2000, 0),
]  # the file's min, max and scale; what counts beside the EDS's 0 … 2500


WITHIN: list[tuple[float | None, float | None, float, bool]] = [
    (2500, None, 1.0, True),
    (2501, None, 1.0, False),
    (None, 0, 1.0, True),
    (None, -1, 1.0, False),
    (250, None, 0.1, True),
    (250.1, None, 0.1, False),
    (1, 2, -1.0, False),
]  # the file's min, max and scale; whether the EDS's 0 … 2500 leaves anything


def check_described(module: ModuleType) -> None:
    for low, high, scale, expected_low, expected_high in STRICTER:
        settings = ParameterSettings(object="0x6072:0", min=low, max=high, scale=scale)
        found = module.described("knee.x", settings, {"knee": drive()}, {})
        assert (found.min, found.max, found.lock, found.problem) == (expected_low, expected_high, None, None)
        assert (found.data_type, found.access, found.store) == (0x06, "rw", True)
        assert found.default == pytest.approx(1000 * scale)
    for least, most, scale, within in WITHIN:
        settings = ParameterSettings(object="0x6072:0", min=least, max=most, scale=scale)
        found = module.described("knee.x", settings, {"knee": drive()}, {})
        assert (found.problem is None) is within
        assert refused(found.check_writable) == (None if within else ErrorKind.UNAVAILABLE)
    for object_, absent in (("0x7000:0", {}), ("0x1008:0", {}), ("0x6072:0", {"knee": "no power"})):
        found = module.described("knee.x", ParameterSettings(object=object_), {"knee": drive()}, absent)
        assert found.problem is not None
    unlimited = module.described("knee.x", ParameterSettings(object="0x6065:0"), {"knee": drive()}, {})
    assert (unlimited.min, unlimited.max, unlimited.default) == (None, None, None)


VARIABLES = {
    (0x6072, 0): SimpleNamespace(data_type=0x06, access_type="rw", min=0, max=2500, default=1000),
    (0x6065, 0): SimpleNamespace(data_type=0x07, access_type="rw", min=None, max=None, default=None),
    (0x1008, 0): SimpleNamespace(data_type=0x09, access_type="const", min=None, max=None, default=None),
}


def drive() -> Any:
    """As much of an EDS as is asked for."""
    return SimpleNamespace(
        path=Path("drive.eds"),
        variable=lambda index, subindex: VARIABLES.get((index, subindex)),
        has=lambda index, subindex: (index, subindex) == (0x1010, 1),
    )


# What locks an object of an EDS

LOCKS = [
    (0x2030, (), Lock.UNRELEASED),
    (0x2030, ("x",), None),
    (0x2030, ("*",), None),
    (0x2030, ("y*",), Lock.UNRELEASED),
    (0x2030, ("{address}",), None),
    (0x1FFF, ("*", "x"), Lock.COMMUNICATION),
    (0x1000, ("x",), Lock.COMMUNICATION),
    (0x2000, ("x",), None),
    (0x1010, ("*", "x"), Lock.STORAGE),
    (0x1011, ("x",), Lock.STORAGE),
    (0x6040, ("*", "x"), Lock.CONTROLWORD),
    (0x6840, ("x",), Lock.CONTROLWORD),
    (0x9840, ("x",), Lock.CONTROLWORD),
    (0xA040, ("x",), None),
    (0x5FFF, ("*",), None),
    (0x607A, ("*",), Lock.COMMANDED),
    (0x607A, ("x",), None),
    (0x687A, ("*",), Lock.COMMANDED),
    (0x60FF, ("*",), Lock.COMMANDED),
    (0x2121, ("*",), Lock.COMMANDED),  # an RPDO brings it
    (0x2121, ("x",), None),
    (0x605A, ("*",), Lock.STOPPING),
    (0x605A, ("{address}",), None),
    (0x685A, ("*",), Lock.STOPPING),
]  # index, release, lock


def check_locks(module: ModuleType) -> None:
    for index, release, lock in LOCKS:
        address = f"0x{index:04X}:0"
        named = tuple(one.format(address=address) for one in release)
        fake = SimpleNamespace(_table=SimpleNamespace(release=named), _mapped={(0x2121, 0)})
        variable = SimpleNamespace(index=index, subindex=0)
        assert module._Offer._lock(fake, variable, "x", address) is lock


# In which states of the drives


def check_states(module: ModuleType) -> None:
    moving = {DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE}
    for live, named in itertools.product((True, False), (None, ("fault", "operation enabled"))):
        settings = ParameterSettings(object="0x6072:0", live=live, states=named)
        one = Parameter("knee.x", "knee", settings, 0x6072, 0, UNSIGNED8, "rw")
        for state in (*DriveState, None):
            allowed = named is None or state in (DriveState.FAULT, DriveState.OPERATION_ENABLED)
            at_rest = state not in moving and state is not None
            expected = None if allowed and (live or at_rest) else ErrorKind.WRONG_STATE
            expected = None if live and named is None else expected
            assert refused(lambda one=one, state=state: _check(module, one, 5, 5, state)) == expected  # type: ignore[misc]
    for most, after, kind in ((None, 200, None), (10.0, 60, None), (10.0, 61, ErrorKind.OUT_OF_LIMIT)):
        one = _stepping(most)
        assert refused(lambda one=one, after=after: _check(module, one, after, 50, None)) == kind  # type: ignore[misc]

    with pytest.raises(RpcError) as caught:
        _check(module, _stepping(10.0), 61, 50, None)
    assert str(caught.value).endswith("it may change by 10  at once, not by 11")


def _stepping(most: float | None) -> Parameter:
    settings = ParameterSettings(object="0x6072:0", live=True, max_step=most)
    return Parameter("knee.x", "knee", settings, 0x6072, 0, UNSIGNED8, "rw")


def _check(module: ModuleType, one: Parameter, after: int, before: int, state: DriveState | None) -> None:
    fake = SimpleNamespace(
        _config=SimpleNamespace(drives_of=lambda _component: ("knee",)),
        states=lambda drives: dict.fromkeys(drives, (state, "why")),
    )
    module.Rules.check_value(fake, one, bytes([before]), bytes([after]))
    module.Rules.check_states(fake, one)


def check_enabling(module: ModuleType) -> None:
    """What is on trial bars the way up where it could not be taken back there."""
    enabled, at_rest = ("operation enabled", "fault"), ("fault",)
    for live, states, barred in (
        (False, None, True),
        (True, None, False),
        (True, enabled, False),
        (True, at_rest, True),
        (False, enabled, True),
    ):
        settings = ParameterSettings(object="0x6072:0", live=live, states=states)
        one = Parameter("knee.x", "knee", settings, 0x6072, 0, UNSIGNED8, "rw")
        fake = SimpleNamespace(
            _parameters={"knee.x": one}, _config=SimpleNamespace(drives_of=lambda _component: ("knee",))
        )
        assert module.Rules.bars(fake, "knee.x", ["hip", "knee"]) is barred
        assert module.Rules.bars(fake, "knee.x", ["hip"]) is False
        assert module.Rules.bars(fake, "knee.y", ["knee"]) is False


CHECKS: list[tuple[Callable[[ModuleType], None], ModuleType, tuple[str, ...]]] = [
    (
        check_parameter,
        parameters,
        (
            "read_only",
            "check_readable",
            "check_writable",
            "encode",
            "accepts",
            "_check_limits",
            "contradiction",
        ),
    ),
    (check_coding, coding, ("scaled", "broken_limit", "coding_of", "decode", "encode", "nearest", "_finite")),
    (check_described, catalogue, ("described", "_scaled_limits")),
    (check_locks, eds_parameters, ("_lock", "_axis", "_of_first_axis")),
    (check_states, rules, ("check_value", "check_states", "allowed_states")),
    (check_enabling, rules, ("bars", "_may_be_enabled", "allowed_states")),
]
SAME = ("scale <= 0",)  # a scale is never 0: the robot's file is refused


@pytest.mark.parametrize(("check", "module"), [one[:2] for one in CHECKS])
def test_every_row_holds(check: Callable[[ModuleType], None], module: ModuleType) -> None:
    check(module)


@pytest.mark.parametrize(("check", "module", "names"), CHECKS)
def test_every_mutant_is_noticed(
    check: Callable[[ModuleType], None], module: ModuleType, names: tuple[str, ...]
) -> None:
    tree = ast.parse(inspect.getsource(module))
    assert set(names) <= names_in(tree), f"{module.__name__} no longer has all of these"
    made = [(what, mutant) for what, mutant in mutants(tree, names=names) if not what.endswith(SAME)]
    assert [what for what, mutant in made if _survives(mutant, module, check)] == []
    assert len(made) >= 10


def _survives(mutant: ast.Module, sound: ModuleType, check: Callable[[ModuleType], None]) -> bool:
    """Whether a module of its own, beside the sound one, passes the check."""
    module = ModuleType(f"{sound.__name__}_mutant")
    exec(compile(mutant, str(sound.__file__), "exec"), vars(module))  # our own code, changed in one place
    try:
        check(module)
    except (Exception, pytest.fail.Exception):  # noqa: BLE001 - however it shows
        return False
    return True
