"""A server that is killed at any moment loses nothing that was acknowledged, and stores nothing twice.

5 kills a backend, and 25 by night; GWRMS_KILLS=100 for more.
"""

import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import upload
from tests.scenario.recording_lives import PER_LIFE, ROBOT

KILLS = (5, int(os.environ.get("GWRMS_KILLS", "25")))


def lives(spool: Path, url: str, count: int) -> set[int]:
    """Every number that was acknowledged."""
    command = [
        sys.executable,
        "-m",
        "tests.scenario.recording_lives",
        str(spool),
        url,
        str(count),
        "20261121",
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10 * count + 60)
    assert run.returncode == 0, run.stderr
    told = [int(line) for line in run.stdout.split()]
    return {number for last in told for number in range(last // PER_LIFE * PER_LIFE, last + 1)}


@pytest.mark.timeout(300 + 10 * max(KILLS))
@pytest.mark.parametrize("kills", KILLS)
def test_every_acknowledged_sample_is_in_the_store_exactly_once(
    store_url: str, tmp_path: Path, kills: int
) -> None:
    acknowledged = lives(tmp_path / "spool", store_url, kills)
    store = Store(store_url)
    assert store.dataset(TELEMETRY.location(ROBOT, 1)).count_rows() > 0  # uploaders were killed at work, too
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        for number in spool.waiting():
            segment = spool.read(number)
            upload(segment, spool.id, store)
            segment.close()
    table = store.dataset(TELEMETRY.location(ROBOT, 1)).to_table(columns=["counter.number", "seq"])
    found = Counter(int(value) for value in table.column("counter.number").to_pylist())
    assert table.column("seq").to_pylist() == [
        int(value) for value in table.column("counter.number").to_pylist()
    ]
    assert acknowledged <= found.keys()
    assert set(found.values()) == {1}
