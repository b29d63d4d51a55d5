"""What monitoring costs: in all, for each client, each stream and each bus."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from gateway.cli.cost import text
from gateway.cost import Costs
from gateway.main import main
from gateway.process.loop import Loop
from gateway.streaming.budget import Budget
from gateway.streaming.rates import Rates
from gateway.streaming.streams import Streams
from gateway.wire.cost import BudgetInfo, BusCost, ClientCost, GatewayCost, StreamCost
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, Client, config, serving

Connect = Callable[[], Client]


def test_rates_are_since_the_last_look_and_what_is_new_has_none() -> None:
    rates = Rates()
    rates.look(1_000_000_000)
    assert rates("a", 10) is None
    rates.look(3_000_000_000)
    assert rates("a", 30) == 10
    assert rates("b", 5) is None
    rates.look(4_000_000_000)
    rates.look(5_000_000_000)
    assert rates("a", 40) is None  # forgotten by a look that did not ask


def test_each_client_has_its_own_part_of_what_the_gateway_does(connect: Connect, bench: Bench) -> None:
    quiet, busy, asker = connect(), connect(), connect()
    quiet.call("hello", client="quiet", protocol=1)
    busy.call("hello", client="busy", protocol=1)
    busy.call("stream.start", modules=["component"], rate_hz=500)
    first = asker.call("gateway.cost")
    assert first["cpu_percent"] is None
    assert [one["cpu_percent"] for one in first["clients"]] == [None] * 3
    for _ in range(20):
        busy.data()
    cost = asker.call("gateway.cost")
    clients = {one["who"].partition(" ")[0]: one for one in cost["clients"]}
    assert clients["busy"]["cpu_percent"] > clients["quiet"]["cpu_percent"] == 0
    assert clients["busy"]["sent_bytes_per_s"] > 0
    assert (clients["quiet"]["sent_bytes_per_s"], clients["quiet"]["requests_per_s"]) == (0, 0)
    (stream,) = clients["busy"]["streams"]
    assert (stream["rate_hz"], stream["channels"], stream["dropped"], stream["shed"]) == (500, 6, 0, 1)
    assert stream["rows_per_s"] > 0
    assert cost["cpu_percent"] >= clients["busy"]["cpu_percent"]
    assert cost["rss_bytes"] > 1 << 20
    assert cost["threads"] >= 1
    assert cost["wake_ups_per_s"] > 0
    assert (cost["modules"]["component"], cost["modules"]["guard"]) == ("running", "off")


def test_who_asks_for_the_costs_starts_no_device(connect: Connect, bench: Bench) -> None:
    connect().call("gateway.cost")
    assert bench.assembled == 0


def test_a_client_that_has_gone_costs_nothing(connect: Connect) -> None:
    gone, asker = connect(), connect()
    gone.call("clock.read")
    assert len(asker.call("gateway.cost")["clients"]) == 2
    gone.close()
    until(lambda: len(asker.call("gateway.cost")["clients"]) == 1, "it has gone")


def test_a_bus_tells_what_we_put_on_it_and_how_much_of_it_that_is() -> None:
    loop = Loop()
    streams = Streams(loop, 1 << 20, Budget(loop, None))
    bus = SimpleNamespace(settings=SimpleNamespace(bitrate=1_000_000), sent=0, sent_bytes=0, frames=0)
    costs = Costs()

    def look() -> BusCost:
        return costs.look(1, {}, {"main": cast("Any", bus)}, [], streams, None).buses["main"]

    assert look() == BusCost(None, None, None, None)
    bus.sent, bus.sent_bytes, bus.frames = 100, 800, 5000
    one = look()
    assert one.sent_frames_per_s is not None
    assert one.sent_bytes_per_s == pytest.approx(8 * one.sent_frames_per_s, rel=1e-3)
    assert one.received_frames_per_s == pytest.approx(50 * one.sent_frames_per_s, rel=1e-3)
    bits_per_s = one.sent_frames_per_s * (47 + 64) * 2
    assert one.load_percent == pytest.approx(bits_per_s / 1e4, rel=1e-3)
    loop.close()


def test_a_real_bus_counts_what_it_sends() -> None:
    bus = CanBus("main", CanSettings(interface="virtual", channel="cost"))
    bus.start()
    try:
        until(lambda: bus.opened, "it is open")
        for _ in range(3):
            bus.send(0x602, bytes(8))
        assert (bus.sent, bus.sent_bytes) == (3, 24)
    finally:
        bus.stop()
    with pytest.raises(Unavailable):
        bus.send(0x602, bytes(8))
    assert bus.sent == 3


def test_the_command_asks_twice_and_says_who_causes_what(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with serving(config(tmp_path)) as (host, port), Client((host, port)) as other:
        other.call("hello", client="other", protocol=1)
        other.call("stream.start", modules=["component"], rate_hz=100, channels=["*.position"])
        assert main(["cost", "--robot", f"{host}:{port}", "--seconds", "0.1"]) == 0
    said = capsys.readouterr().out
    assert "of a core" in said
    assert "other (127.0.0.1:" in said
    assert "gwrms cost (127.0.0.1:" in said
    assert "100 Hz" in said


def test_as_text() -> None:
    stream = StreamCost(1, 1000.0, 60, 250.0, 7, 4)
    clients = [ClientCost("window (10.0.0.2:5)", 3.25, 0.5, 70_000.0, 12.0, 2048, [stream])]
    modules = {"component": "running", "guard": "off"}
    buses = {"main": BusCost(40.0, 320.0, 3000.0, 0.888)}
    cost = GatewayCost(1, 7.5, 40 << 20, 9, 812.0, modules, buses, clients, BudgetInfo(5.0, 4))
    assert text(cost) == (
        "CPU      7.5 % of a core, 812.0 wake-ups/s\n"
        "memory   40.0 MiB in 9 threads\n"
        "modules  component\n"
        "bus      main: 40.0 frames/s and 320.0 B/s sent (0.89 % of the bus with their answers), "
        "3000.0 frames/s read\n"
        "budget   at most 5.0 % of a core: streams send one row of 4\n"
        "\n"
        "CLIENT                  CPU  REQUESTS/S    SENT/S  RECEIVED/S  WAITING\n"
        "window (10.0.0.2:5)  3.25 %         0.5  68.4 KiB        12 B  2.0 KiB\n"
        "\n"
        "STREAM OF                   RATE  CHANNELS  ROWS/S  DROPPED\n"
        "window (10.0.0.2:5)  1000 Hz / 4        60   250.0        7\n"
    )


@pytest.mark.parametrize("command", ["cost", "blame"])
@pytest.mark.parametrize("seconds", ["0", "nan", "inf", "soon"])
def test_times_that_make_no_sense_are_refused(
    capsys: pytest.CaptureFixture[str], command: str, seconds: str
) -> None:
    with pytest.raises(SystemExit):
        main([command, "--seconds", seconds])
    assert "no time from" in capsys.readouterr().err
