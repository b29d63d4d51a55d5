"""A test with its result, and beside it the last one of the same joint, with what is not the same in both."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from server_gui.core.joint_tests.file import NotReadable, Test, read
from server_gui.core.joint_tests.friction import friction
from server_gui.core.joint_tests.measures import JointTestResult
from server_gui.core.joint_tests.relay import relay
from server_gui.core.joint_tests.response import frequency_response
from server_gui.core.joint_tests.step import step_response

ANALYSES: Final[Mapping[str, Callable[[Test], JointTestResult]]] = {
    "step": step_response,
    "chirp": frequency_response,
    "friction": friction,
    "relay": relay,
}
_CONDITIONS: Final = ("wish", "limits", "drive", "parameters")
_IDENTITY: Final = {  # CiA 301 §7.5.2.19
    "0x1018:1": "vendor",
    "0x1018:2": "product",
    "0x1018:3": "revision",
    "0x1018:4": "serial number",
}


@dataclass(frozen=True, slots=True)
class AnalysedTest:
    """A test and what it says."""

    test: Test
    result: JointTestResult


def analysed(path: Path) -> AnalysedTest:
    """Read and compute; raises `NotReadable`, `OSError`."""
    test = read(path)
    analysis = ANALYSES.get(test.head.test)
    if analysis is None:
        raise NotReadable(
            f"{path} is a {test.head.test!r} test, which this program does not know: use a newer one"
        )
    if len(test["sync_ns"]) < 2:
        raise NotReadable(f"{path} has no samples: {test.problem or 'nothing was recorded'}")
    return AnalysedTest(test, analysis(test))


def last_before(test: Test) -> Path | None:
    """Return the newest older complete test of the same robot, joint and kind beside it."""
    head, found = test.head, []
    for path in test.path.parent.glob(f"*.{head.joint}.{head.test}.*.jsonl"):
        try:
            other = read(path)
        except (NotReadable, OSError):
            continue
        same = (other.head.robot, other.head.joint, other.head.test) == (head.robot, head.joint, head.test)
        if same and other.head.began < head.began and other.problem is None:
            found.append((other.head.began, path))
    return max(found)[1] if found else None


def differences(one: Test, other: Test) -> Iterator[str]:
    """Yield the other differences between two tests, in words: `other` is the older one."""
    if one.head.robot != other.head.robot or one.head.joint != other.head.joint:
        yield f"another joint: {other.head.robot} {other.head.joint}, now {one.head.robot} {one.head.joint}"
    for name in _CONDITIONS:
        before, now = _flat(getattr(other.head, name)), _flat(getattr(one.head, name))
        for key in sorted(before.keys() | now.keys()):
            if before.get(key) != now.get(key):
                what = f"another drive: its {_IDENTITY[key]}" if key in _IDENTITY else f"{name} {key}"
                yield f"{what}: {_word(before.get(key))}, now {_word(now.get(key))}"
    if one.head.period_s != other.head.period_s:
        yield f"a target each {other.head.period_s * 1000:g} ms, now {one.head.period_s * 1000:g} ms"


def _flat(table: Mapping[str, Any]) -> dict[str, Any]:
    return dict(table)


def _word(value: object) -> str:
    return "not there" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def told(shown: AnalysedTest, last: AnalysedTest | None) -> dict[str, Any]:
    """Return all of it as plain values, for JSON."""
    before = None
    if last is not None:
        before = {
            "file": str(last.test.path),
            "began": last.test.head.began,
            "measures": msgspec.to_builtins(last.result.measures),
            "differences": list(differences(shown.test, last.test)),
        }
    head = shown.test.head
    return {
        "file": str(shown.test.path),
        "robot": head.robot,
        "joint": head.joint,
        "test": head.test,
        "began": head.began,
        "problem": shown.test.problem,
        **msgspec.to_builtins(shown.result),
        "last": before,
    }
