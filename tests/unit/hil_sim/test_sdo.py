"""The SDO server, frame by frame as CiA 301 §7.2.4.3 draws it."""

import pytest

from tests.unit.hil_sim.bench import NODE, Bench


@pytest.fixture
def booted(bench: Bench) -> Bench:
    bench.boot()
    return bench


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        ("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 02 00"),  # device type, 4 bytes
        ("40 17 10 00 00 00 00 00", "4B 17 10 00 64 00 00 00"),  # heartbeat, 2 bytes
        ("40 60 60 00 00 00 00 00", "4F 60 60 00 08 00 00 00"),  # mode, 1 byte
        ("40 00 18 01 00 00 00 00", "43 00 18 01 85 01 00 40"),  # COB-ID with the node's own id
        ("2B 72 60 00 E8 03 00 00", "60 72 60 00 00 00 00 00"),  # max torque
        ("22 81 60 00 00 80 00 00", "60 81 60 00 00 00 00 00"),  # size not indicated
    ],
)
def test_expedited_transfer(booted: Bench, request_: str, response: str) -> None:
    assert booted.sdo(request_) == response


@pytest.mark.parametrize(
    ("request_", "abort"),
    [
        ("40 34 12 00 00 00 00 00", "80 34 12 00 00 00 02 06"),  # no such object
        ("40 18 10 09 00 00 00 00", "80 18 10 09 11 00 09 06"),  # no such sub-index
        ("2B 41 60 00 00 00 00 00", "80 41 60 00 02 00 01 06"),  # read only
        ("2F 72 60 00 01 00 00 00", "80 72 60 00 13 00 07 06"),  # too short
        ("23 72 60 00 01 00 00 00", "80 72 60 00 12 00 07 06"),  # too long
        ("2B 72 60 00 C5 09 00 00", "80 72 60 00 31 00 09 06"),  # 2501 per mille: too high
        ("23 81 60 00 E7 03 00 00", "80 81 60 00 32 00 09 06"),  # 999 counts/s: too low
        ("2F 60 60 00 02 00 00 00", "80 60 60 00 30 00 09 06"),  # a mode that the drive has not
        ("2B 5A 60 00 04 00 00 00", "80 5A 60 00 30 00 09 06"),  # an option that the drive has not
        ("E0 00 10 00 00 00 00 00", "80 00 10 00 01 00 04 05"),  # no such command
        ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),  # a segment of no transfer
    ],
)
def test_refusals_name_their_reason(booted: Bench, request_: str, abort: str) -> None:
    assert booted.sdo(request_) == abort


def test_a_refused_value_leaves_the_old_one(booted: Bench) -> None:
    assert booted.write(0x6072, 0, 2501, 2) == "06090031"
    assert booted.read(0x6072) == 2000


def test_segmented_upload_of_a_string(booted: Bench) -> None:
    assert booted.sdo("40 08 10 00 00 00 00 00") == "41 08 10 00 11 00 00 00"
    assert booted.sdo("60 00 00 00 00 00 00 00") == "00 47 57 52 4D 53 20 6A"
    assert booted.sdo("70 00 00 00 00 00 00 00") == "10 6F 69 6E 74 20 64 72"
    assert booted.sdo("60 00 00 00 00 00 00 00") == "09 69 76 65 00 00 00 00"


def test_segmented_download(booted: Bench) -> None:
    assert booted.sdo("21 81 60 00 04 00 00 00") == "60 81 60 00 00 00 00 00"
    assert booted.sdo("07 40 9C 00 00 00 00 00") == "20 00 00 00 00 00 00 00"
    assert booted.read(0x6081) == 40_000


def test_segmented_download_of_a_wrong_length_is_refused_at_once(booted: Bench) -> None:
    assert booted.sdo("21 72 60 00 03 00 00 00") == "80 72 60 00 12 00 07 06"
    assert booted.sdo("21 41 60 00 02 00 00 00") == "80 41 60 00 02 00 01 06"


def test_a_toggle_bit_that_does_not_change_ends_the_transfer(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    booted.sdo("60 00 00 00 00 00 00 00")
    assert booted.sdo("60 00 00 00 00 00 00 00") == "80 08 10 00 00 00 03 05"
    assert booted.sdo("70 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_a_clients_abort_is_not_answered_and_ends_the_transfer(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    assert booted.sdo("80 08 10 00 00 00 04 05") is None
    assert booted.sdo("60 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_a_stopped_node_is_silent(booted: Bench) -> None:
    booted.send(0x000, f"02 {NODE:02X}")
    assert booted.sdo("40 00 10 00 00 00 00 00") is None
    booted.send(0x000, f"80 {NODE:02X}")
    assert booted.sdo("40 00 10 00 00 00 00 00") is not None


def test_a_second_server_answers_once_it_is_configured(booted: Bench) -> None:
    assert booted.write(0x1201, 1, 0x640 + NODE, 4) == "ok"
    assert booted.write(0x1201, 2, 0x5C0 + NODE, 4) == "ok"
    booted.run(1)
    booted.send(0x640 + NODE, "40 00 10 00 00 00 00 00")
    assert booted.of(0x5C0 + NODE) == [bytes.fromhex("43 00 10 00 92 01 02 00")]
