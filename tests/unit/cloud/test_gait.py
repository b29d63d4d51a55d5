"""`gwrms sessions gait`: how somebody walked, out of a store."""

import json
import math
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pytest

from gateway.client import Batch
from gateway.main import main
from ml.store import Store
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send

ON, OFF = 4.0, 2.0  # states of a drive
RATE_HZ, SECONDS, STRIDE_S, STANCE = 100, 30, 1.2, 0.6
SETUP = {"enabled/left_knee.state": "4", "enabled/left_hip.state": "4"}


def force(time_s: float, phase: float) -> float:
    """An insole's: half a sine while the foot stands."""
    at = (time_s / STRIDE_S + phase) % 1.0
    return 700.0 * math.sin(math.pi * at / STANCE) if at < STANCE else 0.0


def walked(folder: Path, url: str, setup: Mapping[str, str] = MappingProxyType({})) -> str:
    """Its drives are enabled in the first 20 s; what they tell later is no tracking error."""
    with Spool(folder / "spool", reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            if setup:
                recorder.begin("exo-01", Facts(setup={**setup}))
            for second in range(SECONDS):
                times_s = [second + row / RATE_HZ for row in range(RATE_HZ)]
                columns: dict[str, list[float | None]] = {
                    "left_insole.force": [force(at_s, 0.0) for at_s in times_s],
                    "right_insole.force": [force(at_s, 0.5) for at_s in times_s],
                    "left_knee.following_error": [math.radians(1.0 if second < 20 else 40.0)] * RATE_HZ,
                    "left_knee.state": [ON if second < 20 else OFF] * RATE_HZ,
                    "left_hip.following_error": [math.radians(40.0)] * RATE_HZ,
                    "left_hip.state": [OFF] * RATE_HZ,
                }
                stamps_ns = [round(at_s * 1e9) for at_s in times_s]
                recorder.record(
                    "exo-01", 1, Batch(stamps_ns, columns, second, 0, 0, 1, time.monotonic_ns()), 0
                )
        send(spool, 1, Store(url))
    return "2"  # how every session's name begins


def test_a_recorded_walk_is_told_in_figures(
    folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = walked(tmp_path, folder_url, SETUP)
    assert main(["sessions", "gait", name, "--url", folder_url, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["gait"]["cadence_spm"] == pytest.approx(120.0 / STRIDE_S, rel=0.01)
    for leg in ("left", "right"):
        assert found["gait"]["legs"][leg]["stance"] == pytest.approx(STANCE, abs=0.03)
    assert found["gait"]["symmetry"]["stance"] == pytest.approx(0.0, abs=0.03)
    one = pytest.approx(math.radians(1.0))
    assert found["errors"]["left_knee"] == {"rms": one, "largest": one, "while_enabled": True}
    assert found["errors"]["left_hip"] is None, "its drive was never enabled"
    assert main(["sessions", "gait", name, "--url", folder_url, "--to", "15"]) == 0
    told = capsys.readouterr().out
    assert "cadence 100.0 steps a minute" in told
    assert "left_knee" in told
    assert "1.00°" in told
    assert "no value while its drive was enabled" in told


def test_a_recording_that_does_not_say_when_drives_were_enabled_says_that(
    folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = walked(tmp_path, folder_url)
    assert main(["sessions", "gait", name, "--url", folder_url]) == 0
    told = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "left_hip 40.00° 40.00° at all times: its drive's state was not recorded" in told


def test_where_nobody_walks_it_says_what_is_needed(
    folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = walked(tmp_path, folder_url)
    assert main(["sessions", "gait", name, "--url", folder_url, "--from", "29"]) == 0
    assert "no stride was found: is there an insole" in capsys.readouterr().out
