"""Faults of the whole bus, as ISO 11898-1 says that they look."""

from pathlib import Path

import can
import pytest

from hil_sim.exoskeleton import Scenario
from tests.unit.hil_sim.outside import KNEE, Outside, errors, is_frame, of

SYNCS_PER_S = 100  # 1006h of the controller


def count(messages: list[can.Message], cob_id: int) -> int:
    return len(of(messages, cob_id))


def test_frame_loss_misses_its_share_and_shows_no_error_frame(shared: Outside) -> None:
    assert count(shared.run(1.0), 0x080) == SYNCS_PER_S
    shared.faults.begin("frame_loss", params={"percent": 30})
    messages = shared.run(2.0)
    assert count(messages, 0x080) == pytest.approx(0.7 * 2 * SYNCS_PER_S, abs=25)  # four standard deviations
    assert errors(messages) == 0
    shared.faults.clear()
    assert count(shared.run(1.0), 0x700 + KNEE) == 10


def test_frame_loss_of_everything_is_silence(shared: Outside) -> None:
    shared.faults.begin("frame_loss", params={"percent": 100})
    assert shared.run(0.3) == []


def test_frame_loss_is_the_same_with_the_same_seed_only(tmp_path: Path) -> None:
    def heard(seed: int) -> list[tuple[int, bytes]]:
        outside = Outside(tmp_path, Scenario.STAND, seed)
        outside.faults.begin("frame_loss", params={"percent": 30})
        messages = [(message.arbitration_id, bytes(message.data)) for message in outside.run(0.3)]
        outside.close()
        return messages

    assert heard(1) == heard(1) != heard(2)


def test_error_frames_delay_and_lose_nothing(shared: Outside) -> None:
    quiet = shared.run(1.0)
    before = {cob_id: count(quiet, cob_id) for cob_id in (0x080, 0x180 + KNEE, 0x700 + KNEE)}
    shared.faults.begin("error_frames", params={"percent": 40})
    messages = shared.run(1.0)
    frames = len(messages) - errors(messages)
    assert errors(messages) / (errors(messages) + frames) == pytest.approx(0.4, abs=0.05)
    for cob_id, was in before.items():
        assert count(messages, cob_id) == pytest.approx(was, abs=1)


def test_error_frames_are_marked_as_errors_on_the_bus(shared: Outside) -> None:
    shared.faults.begin("error_frames", params={"percent": 40})
    one = next(message for message in shared.run(0.1) if message.is_error_frame)
    assert one.arbitration_id == 0x088  # Linux can/error.h: a protocol violation, an error on the bus


def load(messages: list[can.Message], seconds: float) -> float:
    """Share of the time that these frames take at 1 Mbit/s, with 7.4 % of the stuffable bits stuffed."""
    sizes = [8 * len(message.data) for message in messages]
    return sum(47 + bits + 0.074 * (34 + bits) for bits in sizes) / 1e6 / seconds


@pytest.mark.parametrize("percent", [50, 90])
def test_bus_load_fills_the_bus_up_to_its_share(shared: Outside, percent: int) -> None:
    shared.faults.begin("bus_load", params={"percent": percent})
    messages = shared.run(0.5)
    assert load(messages, 0.5) == pytest.approx(percent / 100, abs=0.03)
    assert count(messages, 0x180 + KNEE) == pytest.approx(50, abs=1)
    assert shared.read(KNEE, 0x6041)


def test_bus_load_of_100_percent_starves_what_has_a_higher_identifier(shared: Outside) -> None:
    shared.faults.begin("bus_load", params={"percent": 100, "cob_id": "0x181"}, for_s=0.5)
    shared.run(0.05)
    messages = shared.run(0.4)
    assert load(messages, 0.4) == pytest.approx(1.0, abs=0.01)
    assert count(messages, 0x180 + KNEE) == 0
    assert count(messages, 0x700 + KNEE) == 0
    assert count(messages, 0x080) == pytest.approx(40, abs=1)  # SYNC has a lower one
    assert count(shared.run(0.5), 0x700 + KNEE) > 0


def test_bus_load_of_the_lowest_priority_delays_the_robot_by_no_more_than_a_frame(shared: Outside) -> None:
    quiet = gaps(shared.run(0.5))
    shared.faults.begin("bus_load", params={"percent": 100})
    shared.run(0.05)
    loaded = gaps(shared.run(0.5))
    assert max(loaded) <= max(quiet) + 2 * 0.000_13


def gaps(messages: list[can.Message]) -> list[float]:
    """How long after its SYNC the knee's PDO came (s)."""
    found, sync_s = [], None
    for message in messages:
        if is_frame(message, 0x080):
            sync_s = message.timestamp
        elif is_frame(message, 0x180 + KNEE) and sync_s is not None:
            found.append(message.timestamp - sync_s)
    return found


def test_bus_cut_hears_nothing_and_reaches_nobody_while_the_robot_walks_on(outside: Outside) -> None:
    outside.faults.begin("bus_cut", for_s=0.5)
    assert outside.ask(KNEE, bytes.fromhex("2b40600000000000"), 0.4) == []  # disable voltage
    assert outside.messages[-1].timestamp < outside.now_s - 0.35
    messages = outside.run(0.5)
    assert {word & 0x6F for word in (int.from_bytes(d[:2], "little") for d in of(messages, 0x182))} == {0x27}


def test_gateway_bus_off_is_told_and_then_nothing_passes_until_it_is_over(shared: Outside) -> None:
    shared.faults.begin("gateway_bus_off", for_s=0.3)
    told, *frames = shared.run(0.25)
    assert (told.is_error_frame, told.arbitration_id) == (True, 0x040)  # Linux can/error.h: CAN_ERR_BUSOFF
    assert frames == []
    messages = shared.run(0.5)
    assert (messages[0].is_error_frame, messages[0].arbitration_id) == (True, 0x100)  # CAN_ERR_RESTARTED
    assert count(messages, 0x080) > 40


def test_sync_lost_takes_the_synchronous_pdos_with_it_and_leaves_the_rest(shared: Outside) -> None:
    shared.faults.begin("sync_lost")
    shared.run(0.05)
    messages = shared.run(1.0)
    assert [count(messages, one) for one in (0x080, 0x180 + KNEE, 0x700 + KNEE)] == [0, 0, 10]
    assert shared.read(KNEE, 0x6041)


def test_sync_lost_in_part_is_the_share_that_is_said(shared: Outside) -> None:
    shared.faults.begin("sync_lost", params={"percent": 50})
    assert count(shared.run(2.0), 0x080) == pytest.approx(SYNCS_PER_S, abs=28)  # four standard deviations
