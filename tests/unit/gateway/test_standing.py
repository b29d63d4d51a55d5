"""What must run without any client, and cannot: it is tried again, one time after the other, ever later."""

import itertools
import time
from collections import defaultdict
from pathlib import Path

import pytest

from gateway import always_on
from gateway.registry import Context, Spec
from tests.unit.gateway.harness import ROBOT, config, serving, until

GUARDED = ROBOT + "[guard.rule.lost]\nwatch = 'node_lost'\nactions = ['alarm']\n"
tried: dict[str, list[float]] = defaultdict(list)


class Broken:
    """A module that never starts."""

    name = ""

    def __init__(self, context: Context) -> None:
        tried[self.name].append(time.monotonic())
        raise OSError("it is broken")


class Guard(Broken):
    name = "guard"


class Control(Broken):
    name = "control"


def test_what_cannot_begin_is_tried_again_once_at_a_time_and_ever_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(always_on, "AGAIN_S", 0.01)
    monkeypatch.setattr(always_on, "LATEST_S", 0.04)
    tried.clear()
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "stop.json").write_bytes(b"{}")  # the last gateway held a stop
    specs = {name.lower(): Spec(f"{__name__}:{name}") for name in ("Guard", "Control")}
    robot = config(tmp_path, GUARDED.replace("linger_s", 'records = "records"\nlinger_s'))
    with serving(robot, specs=specs):
        until(lambda: all(len(tried[name]) >= 6 for name in specs), "each was tried again and again")
    for times in tried.values():
        pauses = [after - before for before, after in itertools.pairwise(times)]
        assert all(
            pause >= least for pause, least in zip(pauses, [0.01, 0.02, 0.04, 0.04, 0.04], strict=False)
        )
    assert "the guard does not run" in caplog.text
    assert "what the last gateway left" in caplog.text
