"""SDO block transfer, frame by frame as CiA 301 §7.2.4.3.9 draws it; the CRC is made bit by bit."""

from pathlib import Path

import pytest

from tests.unit.hil_sim.bench import NODE, DeviceBench
from tests.unit.hil_sim.device_file import DOMAIN, UNSIGNED32, VISIBLE_STRING, communication

REQUEST, RESPONSE = 0x600 + NODE, 0x580 + NODE
TEXT = "A device's name that is long enough for blocks"
LARGE = bytes(index * 7 % 251 for index in range(3000))


def crc16(data: bytes) -> int:
    """x¹⁶ + x¹² + x⁵ + 1, bit by bit; "123456789" gives 31C3h (CiA 301 §7.2.4.3.16)."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


@pytest.fixture
def device(tmp_path: Path) -> DeviceBench:
    file = communication().add(0x1008, None, VISIBLE_STRING, TEXT, "const")
    file.add(0x2000, None, DOMAIN, LARGE.hex()).add(0x2001, None, UNSIGNED32, 7)
    file.add(0x2002, None, VISIBLE_STRING, "", "rw").add(0x2003, None, UNSIGNED32, 7, "wo")
    bench = DeviceBench(file.write(tmp_path))
    bench.boot()
    return bench


def exchange(device: DeviceBench, request: str, milliseconds: float = 60) -> list[str]:
    """Every answer to one request, and to nothing (a block's segments take their time)."""
    before = len(device.of(RESPONSE))
    device.send(REQUEST, request)
    device.run(milliseconds)
    return [data.hex(" ").upper() for data in device.of(RESPONSE)[before:]]


def segments(data: bytes) -> list[bytes]:
    return [data[start : start + 7] for start in range(0, len(data), 7)]


def send_block(device: DeviceBench, block: list[bytes], last: bool, lost: tuple[int, ...] = ()) -> list[str]:
    answers = list[str]()
    for number, segment in enumerate(block, 1):
        if number not in lost:
            command = number | (0x80 if last and number == len(block) else 0)
            answers += exchange(device, f"{command:02X} {segment.ljust(7, bytes(1)).hex()}", 1)
    return answers


def end(data: bytes, crc: int | None = None) -> str:
    unused = 7 - len(segments(data)[-1])
    check = (crc16(data) if crc is None else crc).to_bytes(2, "little")
    return f"{0xC1 | unused << 2:02X} {check.hex()} 00 00 00 00 00"


def test_the_tests_own_crc() -> None:
    assert crc16(b"123456789") == 0x31C3


# -- upload ----------------------------------------------------------------------------------------------


def test_upload_in_one_block(device: DeviceBench) -> None:
    data = TEXT.encode()
    assert exchange(device, "A4 08 10 00 7F 00 00 00") == [f"C6 08 10 00 {len(data):02X} 00 00 00"]
    got = exchange(device, "A3 00 00 00 00 00 00 00")
    assert [int(one[:2], 16) for one in got] == [1, 2, 3, 4, 5, 6, 0x87]
    assert b"".join(bytes.fromhex(one)[1:] for one in got)[: len(data)] == data
    unused = 7 - len(data) % 7
    crc = crc16(data).to_bytes(2, "little").hex(" ").upper()
    assert exchange(device, "A2 07 7F 00 00 00 00 00") == [f"{0xC1 | unused << 2:02X} {crc} 00 00 00 00 00"]
    assert exchange(device, "A1 00 00 00 00 00 00 00") == []
    assert device.read(0x2001) == 7


def upload(device: DeviceBench, sizes: list[int], taken: list[int]) -> bytes:
    """A client that asks for blocks of `sizes` segments and takes only the first `taken` of each."""
    exchange(device, f"A4 00 20 00 {sizes[0]:02X} 00 00 00")
    answers = exchange(device, "A3 00 00 00 00 00 00 00")
    data = b""
    for number in range(1000):
        size, kept = sizes[min(number, len(sizes) - 1)], taken[min(number, len(taken) - 1)]
        got = [bytes.fromhex(answer) for answer in answers]
        assert [one[0] & 0x7F for one in got] == list(range(1, len(got) + 1))
        assert len(got) == size or got[-1][0] & 0x80
        kept = min(kept, len(got))
        data += b"".join(one[1:] for one in got[:kept])
        answers = exchange(
            device, f"A2 {kept:02X} {sizes[min(number + 1, len(sizes) - 1)]:02X} 00 00 00 00 00"
        )
        if got[kept - 1][0] & 0x80 and kept == len(got):
            break
    closing = bytes.fromhex(answers[0])
    assert closing[0] & 0xE3 == 0xC1
    data = data[: len(data) - (closing[0] >> 2 & 7)]
    assert closing[1:3] == crc16(data).to_bytes(2, "little")
    assert exchange(device, "A1 00 00 00 00 00 00 00") == []
    return data


@pytest.mark.parametrize("size", [1, 2, 7, 126, 127])
def test_upload_in_blocks_of_every_size(device: DeviceBench, size: int) -> None:
    assert upload(device, [size], [127]) == LARGE


def test_the_client_may_change_the_size_from_block_to_block(device: DeviceBench) -> None:
    assert upload(device, [5, 127, 1, 30], [127]) == LARGE


def test_what_the_client_did_not_get_is_sent_again(device: DeviceBench) -> None:
    assert upload(device, [100], [60, 3, 100, 99, 100]) == LARGE


def test_upload_without_crc(device: DeviceBench) -> None:
    exchange(device, "A0 08 10 00 7F 00 00 00")
    exchange(device, "A3 00 00 00 00 00 00 00")
    assert exchange(device, "A2 07 7F 00 00 00 00 00")[0][3:8] == "00 00"


@pytest.mark.parametrize(
    ("threshold", "answer"), [(4, "43 01 20 00 07 00 00 00"), (3, "C6 01 20 00 04 00 00 00")]
)
def test_below_the_clients_threshold_the_upload_is_an_ordinary_one(
    device: DeviceBench, threshold: int, answer: str
) -> None:
    assert exchange(device, f"A4 01 20 00 7F {threshold:02X} 00 00") == [answer]


def test_an_ordinary_upload_in_place_of_a_block_may_be_segmented(device: DeviceBench) -> None:
    assert exchange(device, "A4 08 10 00 7F FF 00 00")[0][:2] == "41"
    assert exchange(device, "60 00 00 00 00 00 00 00")[0][:2] == "00"


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("A4 00 20 00 00 00 00 00", "02 00 04 05"),  # a block of no segments
        ("A4 00 20 00 80 00 00 00", "02 00 04 05"),
        ("A4 34 12 00 7F 00 00 00", "00 00 02 06"),
        ("A4 00 20 01 7F 00 00 00", "11 00 09 06"),
        ("A4 03 20 00 7F 00 00 00", "01 00 01 06"),
    ],
)
def test_uploads_that_cannot_begin(device: DeviceBench, request_: str, code: str) -> None:
    assert exchange(device, request_) == [f"80 {request_[3:11]} {code}"]


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("A2 08 7F 00 00 00 00 00", "03 00 04 05"),  # acknowledges what was not sent
        ("A2 05 00 00 00 00 00 00", "02 00 04 05"),
        ("A2 05 80 00 00 00 00 00", "02 00 04 05"),
        ("A3 00 00 00 00 00 00 00", "01 00 04 05"),  # already started
        ("A1 00 00 00 00 00 00 00", "01 00 04 05"),  # not at its end
    ],
)
def test_an_upload_ends_where_the_client_says_what_cannot_be(
    device: DeviceBench, request_: str, code: str
) -> None:
    exchange(device, "A4 08 10 00 7F 00 00 00")
    exchange(device, "A3 00 00 00 00 00 00 00")
    assert exchange(device, request_) == [f"80 08 10 00 {code}"]
    assert exchange(device, "A2 07 7F 00 00 00 00 00") == ["80 00 00 00 01 00 04 05"]


def test_a_client_that_aborts_gets_no_more_segments(device: DeviceBench) -> None:
    exchange(device, "A4 00 20 00 7F 00 00 00")
    before = len(device.of(RESPONSE))
    device.send(REQUEST, "A3 00 00 00 00 00 00 00")
    device.send(REQUEST, "80 00 20 00 00 00 00 08")
    got = len(device.of(RESPONSE)) - before
    assert 1 < got < 30
    assert exchange(device, "40 01 20 00 00 00 00 00") == ["43 01 20 00 07 00 00 00"]


def test_a_client_that_does_not_acknowledge_is_told_so(device: DeviceBench) -> None:
    exchange(device, "A4 08 10 00 7F 00 00 00")
    exchange(device, "A3 00 00 00 00 00 00 00")
    device.run(1000)
    assert device.of(RESPONSE)[-1] == bytes.fromhex("80 08 10 00 00 00 04 05")


# -- download --------------------------------------------------------------------------------------------


def test_download_in_one_block(device: DeviceBench) -> None:
    data = b"a note that is longer than a segment"
    assert exchange(device, f"C6 02 20 00 {len(data):02X} 00 00 00") == ["A4 02 20 00 7F 00 00 00"]
    block = segments(data)
    assert send_block(device, block, last=True) == [f"A2 {len(block):02X} 7F 00 00 00 00 00"]
    assert exchange(device, end(data)) == ["A1 00 00 00 00 00 00 00"]
    assert device.node.dictionary[0x2002, 0].value == data.decode()


def test_download_in_several_blocks(device: DeviceBench) -> None:
    data = LARGE[::-1]
    exchange(device, f"C6 00 20 00 {len(data).to_bytes(4, 'little').hex()}")
    left = segments(data)
    while left:
        block, left = left[:127], left[127:]
        assert send_block(device, block, last=not left) == [f"A2 {len(block):02X} 7F 00 00 00 00 00"]
    assert device.node.dictionary[0x2000, 0].value == LARGE  # not before the CRC has been seen
    assert exchange(device, end(data)) == ["A1 00 00 00 00 00 00 00"]
    assert device.node.dictionary[0x2000, 0].value == data


def test_what_the_server_did_not_get_is_asked_for_again(device: DeviceBench) -> None:
    data = LARGE[:700]  # 100 segments
    exchange(device, "C6 00 20 00 BC 02 00 00")
    left = segments(data)
    assert send_block(device, left, last=True, lost=(40, 60)) == ["A2 27 7F 00 00 00 00 00"]
    left = left[39:]
    assert send_block(device, left, last=True, lost=(1,)) == ["A2 00 7F 00 00 00 00 00"]
    assert send_block(device, left, last=True) == ["A2 3D 7F 00 00 00 00 00"]
    assert exchange(device, end(data)) == ["A1 00 00 00 00 00 00 00"]
    assert device.node.dictionary[0x2000, 0].value == data


def test_a_wrong_crc_is_refused_and_the_old_value_stays(device: DeviceBench) -> None:
    data = LARGE[:70]
    exchange(device, "C6 00 20 00 46 00 00 00")
    send_block(device, segments(data), last=True)
    assert exchange(device, end(data, crc16(data) ^ 1)) == ["80 00 20 00 04 00 04 05"]
    assert device.node.dictionary[0x2000, 0].value == LARGE


def test_a_client_without_crc_is_not_checked(device: DeviceBench) -> None:
    data = LARGE[:70]
    exchange(device, "C2 00 20 00 46 00 00 00")
    send_block(device, segments(data), last=True)
    assert exchange(device, end(data, 0xFFFF)) == ["A1 00 00 00 00 00 00 00"]


def test_a_download_of_unknown_size(device: DeviceBench) -> None:
    data = LARGE[:71]
    exchange(device, "C4 00 20 00 00 00 00 00")
    send_block(device, segments(data), last=True)
    assert exchange(device, end(data)) == ["A1 00 00 00 00 00 00 00"]
    assert device.node.dictionary[0x2000, 0].value == data


def test_four_bytes_may_come_in_a_block(device: DeviceBench) -> None:
    exchange(device, "C6 01 20 00 04 00 00 00")
    assert send_block(device, [b"\x78\x56\x34\x12"], last=True) == ["A2 01 7F 00 00 00 00 00"]
    assert exchange(device, end(b"\x78\x56\x34\x12")) == ["A1 00 00 00 00 00 00 00"]
    assert device.read(0x2001) == 0x12345678


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("C6 08 10 00 04 00 00 00", "02 00 01 06"),
        ("C6 34 12 00 04 00 00 00", "00 00 02 06"),
        ("C6 01 20 00 05 00 00 00", "12 00 07 06"),
        ("C6 01 20 00 03 00 00 00", "13 00 07 06"),
        ("C6 00 20 00 00 00 00 7F", "05 00 04 05"),  # more than the device has room for
    ],
)
def test_downloads_that_cannot_begin(device: DeviceBench, request_: str, code: str) -> None:
    assert exchange(device, request_) == [f"80 {request_[3:11]} {code}"]


def test_a_download_of_another_length_than_announced_is_refused(device: DeviceBench) -> None:
    data = LARGE[:70]
    exchange(device, "C6 00 20 00 45 00 00 00")
    send_block(device, segments(data), last=True)
    assert exchange(device, end(data)) == ["80 00 20 00 10 00 07 06"]


def test_a_download_that_grows_beyond_its_object_is_refused_at_once(device: DeviceBench) -> None:
    exchange(device, "C4 01 20 00 00 00 00 00")
    assert exchange(device, "01 78 56 34 12 00 00 00") == []
    assert exchange(device, "02 00 00 00 00 00 00 00") == ["80 01 20 00 12 00 07 06"]


def test_segment_number_zero_does_not_exist(device: DeviceBench) -> None:
    exchange(device, "C4 00 20 00 00 00 00 00")
    assert exchange(device, "00 01 02 03 04 05 06 07") == ["80 00 20 00 03 00 04 05"]


def test_an_abort_ends_a_download_in_the_middle_of_a_block(device: DeviceBench) -> None:
    exchange(device, "C4 00 20 00 00 00 00 00")
    exchange(device, "01 01 02 03 04 05 06 07")
    assert exchange(device, "80 00 20 00 00 00 00 08") == []
    assert device.read(0x2001) == 7


def test_in_the_middle_of_a_block_everything_is_a_segment(device: DeviceBench) -> None:
    exchange(device, "C4 00 20 00 00 00 00 00")
    assert exchange(device, "40 01 20 00 00 00 00 00") == []  # segment 64, out of turn


def test_a_download_that_stops_coming_times_out(device: DeviceBench) -> None:
    exchange(device, "C4 00 20 00 00 00 00 00")
    exchange(device, "01 01 02 03 04 05 06 07")
    device.run(1000)
    assert device.of(RESPONSE)[-1] == bytes.fromhex("80 00 20 00 00 00 04 05")
    assert device.read(0x2001) == 7


@pytest.mark.parametrize("request_", ["C1 00 00 00 00 00 00 00", "A3 00 00 00 00 00 00 00"])
def test_the_middle_of_no_transfer_is_refused(device: DeviceBench, request_: str) -> None:
    assert exchange(device, request_) == ["80 00 00 00 01 00 04 05"]
