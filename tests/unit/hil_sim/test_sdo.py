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
    assert booted.write(0x1201, 1, 0x680 + NODE, 4) == "ok"
    assert booted.write(0x1201, 2, 0x6C0 + NODE, 4) == "ok"
    booted.send(0x680 + NODE, "40 00 10 00 00 00 00 00")
    assert booted.of(0x6C0 + NODE) == [bytes.fromhex("43 00 10 00 92 01 02 00")]
    assert booted.write(0x1201, 1, 0x690 + NODE, 4) == "06090030"  # not while it is valid
    assert booted.write(0x1201, 1, 0x8000_0690 + NODE, 4) == "ok"
    booted.send(0x680 + NODE, "40 00 10 00 00 00 00 00")
    assert len(booted.of(0x6C0 + NODE)) == 1


def test_identifiers_that_are_restricted_or_extended_are_refused(booted: Bench) -> None:
    for cob_id in (0x001, 0x07F, 0x101, 0x180, 0x581, 0x640, 0x6E0, 0x701, 0x7FF, 0x2000_0681, 0x1681):
        assert booted.write(0x1201, 1, cob_id, 4) == "06090030", hex(cob_id)


def test_channels_do_not_disturb_each_other(booted: Bench) -> None:
    booted.write(0x1201, 1, 0x680 + NODE, 4)
    booted.write(0x1201, 2, 0x6C0 + NODE, 4)
    booted.sdo("40 08 10 00 00 00 00 00")
    booted.send(0x680 + NODE, "21 81 60 00 04 00 00 00")
    assert booted.sdo("60 00 00 00 00 00 00 00") == "00 47 57 52 4D 53 20 6A"
    booted.write(0x1800, 2, 2, 1)  # ends the upload on this channel, and configures a PDO
    booted.send(0x680 + NODE, "07 40 9C 00 00 00 00 00")
    assert booted.of(0x6C0 + NODE)[-1] == bytes.fromhex("20 00 00 00 00 00 00 00")
    assert booted.read(0x6081) == 40_000


def test_a_client_that_falls_silent_is_told_after_a_second(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    booted.run(990)
    assert booted.sdo("60 00 00 00 00 00 00 00") == "00 47 57 52 4D 53 20 6A"
    booted.run(1010)
    assert booted.of(0x580 + NODE)[-1] == bytes.fromhex("80 08 10 00 00 00 04 05")
    assert booted.sdo("70 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_a_finished_transfer_does_not_time_out(booted: Bench) -> None:
    booted.sdo("40 17 10 00 00 00 00 00")
    booted.sdo("21 81 60 00 04 00 00 00")
    booted.sdo("07 40 9C 00 00 00 00 00")
    answers = len(booted.of(0x580 + NODE))
    booted.run(3000)
    assert len(booted.of(0x580 + NODE)) == answers


def test_a_new_initiation_ends_a_transfer(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    assert booted.read(0x1017) == 100
    assert booted.sdo("60 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_a_segment_of_the_other_direction_ends_a_transfer(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    assert booted.sdo("01 41 00 00 00 00 00 00") == "80 08 10 00 01 00 04 05"
    assert booted.sdo("60 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_nmt_stop_ends_a_transfer_without_a_word(booted: Bench) -> None:
    booted.sdo("40 08 10 00 00 00 00 00")
    answers = len(booted.of(0x580 + NODE))
    booted.send(0x000, f"02 {NODE:02X}")
    booted.run(3000)
    assert len(booted.of(0x580 + NODE)) == answers
    booted.send(0x000, f"80 {NODE:02X}")
    assert booted.sdo("60 00 00 00 00 00 00 00") == "80 00 00 00 01 00 04 05"


def test_a_segmented_download_shorter_than_announced_is_refused(booted: Bench) -> None:
    assert booted.sdo("21 81 60 00 04 00 00 00") == "60 81 60 00 00 00 00 00"
    assert booted.sdo("09 40 9C 00 00 00 00 00") == "80 81 60 00 10 00 07 06"


def test_a_segmented_download_without_a_size_is_measured_at_its_end(booted: Bench) -> None:
    assert booted.sdo("20 81 60 00 00 00 00 00") == "60 81 60 00 00 00 00 00"
    assert booted.sdo("0B 40 9C 00 00 00 00 00") == "80 81 60 00 13 00 07 06"


@pytest.mark.parametrize("request_", ["40 08 10", "", "40 08 10 00 00 00 00"])
def test_a_request_that_is_not_eight_bytes_long_is_none(booted: Bench, request_: str) -> None:
    assert booted.sdo(request_) is None


def test_a_remote_frame_is_no_request(booted: Bench) -> None:
    booted.ask(0x600 + NODE)
    assert booted.of(0x580 + NODE) == []
