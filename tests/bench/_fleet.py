"""What collecting a fleet costs: a collector in a process of its own, and its robots in another.

Memory is watched over an hour's batches, files and compactions, of which each comes thirty times as soon as
usual: robots faster than real time would show how much waits, not how much is kept. `GWRMS_COLLECT_S=3600`
for an hour as it is.
"""

import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from server_gui.core.fleet.collector import Collector
from server_gui.core.settings.prediction import PredictionSettings
from server_gui.core.settings.server_file import (
    RecordingSettings,
    RobotSettings,
    ServerSettings,
    StoreSettings,
)

RATE_HZ, CHANNELS = 100, 60
WARM_S, MEASURE_S = 3.0, 20.0
COLLECT_S = float(os.environ.get("GWRMS_COLLECT_S", "120"))
PARTS = 6  # of an hour
LOOK_S = 0.2


def cpu(robots: int) -> dict[str, float]:
    """What following and recording robots at their own rate takes, uploads among it."""
    return _measured("_cpu", robots, MEASURE_S, "--rate", str(RATE_HZ))  # so that one batch is uploaded


def memory(robots: int) -> dict[str, float]:
    """Whether memory grows with what is recorded, uploaded and compacted: MB at most in each part."""
    return _measured("_memory", robots, COLLECT_S / 60, "--rate", str(RATE_HZ))


def _measured(what: str, robots: int, batch_s: float, *options: str) -> dict[str, float]:
    command = [sys.executable, "-m", "tests.wire_robots", str(robots), "--channels", str(CHANNELS), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as served, tempfile.TemporaryDirectory() as folder:
        try:
            assert served.stdout is not None
            ports = served.stdout.readline()
            script = f"from tests.bench import _fleet; _fleet.run({what!r}, {ports!r}, {folder!r}, {batch_s})"
            collecting = [sys.executable, "-c", script]
            found = subprocess.run(collecting, stdout=subprocess.PIPE, text=True, check=True)
        finally:
            served.kill()
    result: dict[str, float] = json.loads(found.stdout)
    return result


def run(what: str, ports: bytes, folder: str, batch_s: float) -> None:
    """Collect these robots; for a process of its own, which prints what was measured."""
    gc.freeze()  # as `gwrms collect` does
    robots = {f"exo-{i:02}": RobotSettings(f"127.0.0.1:{port}") for i, port in enumerate(json.loads(ports))}
    store = StoreSettings((Path(folder) / "store").as_uri(), compact_h=batch_s * 20 / 3600)
    recorder = RecordingSettings(spool=Path(folder) / "spool", batch_s=batch_s)
    settings = ServerSettings(robots, store, recorder, PredictionSettings(enabled=False))
    with Collector(settings) as collector:
        measured = globals()[what](collector, len(robots))
    sys.stdout.write(json.dumps(measured))


def _cpu(collector: Collector, robots: int) -> dict[str, float]:
    collector.wait(WARM_S)
    began_s, rows = time.process_time(), _rows(collector)
    collector.wait(MEASURE_S)
    took_s, rows = time.process_time() - began_s, _rows(collector) - rows
    # Of a second in which all of them send: also on a computer too busy to let them.
    return {"cores": took_s / rows * robots * RATE_HZ, "rows": rows, **_losses(collector)}


def _memory(collector: Collector, robots: int) -> dict[str, float]:
    began_s, seen = time.monotonic(), []
    while (now_s := time.monotonic() - began_s) < COLLECT_S:
        collector.wait(LOOK_S)
        seen.append((now_s, _resident_mb()))
    most = {
        str(part): max(mb for now_s, mb in seen if part - 1 < PARTS * now_s / COLLECT_S <= part)
        for part in range(1, PARTS + 1)
    }
    return {**most, "batches": collector.report().result().uploader.uploaded, **_losses(collector)}


def _losses(collector: Collector) -> dict[str, float]:
    report = collector.report().result()
    missing = sum(link.missed + link.dropped for link in report.robots.values())
    return {"lost": report.recorder.lost + missing}


def _rows(collector: Collector) -> int:
    return sum(link.rows for link in collector.report().result().robots.values())


def _resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / (1 << 20)
