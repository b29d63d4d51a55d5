"""An unknown stream is told apart from all others, and noise is called noise."""

import random

import pytest

from drivers.identify import matches, recognise
from tests.unit.sensor_cli.streams import GRID_EXAMPLE, stream_of, streams


@pytest.mark.parametrize("name", streams())
def test_every_format_is_recognised_and_nothing_else_fits(name: str) -> None:
    found = matches(streams()[name])
    assert [match.format_name for match in found] == [name]
    assert found[0].share > 0.9


def test_described_frame_names_its_layout_and_cells() -> None:
    match = recognise(GRID_EXAMPLE * 10)
    assert match is not None
    assert (match.format_name, match.layout, match.cells) == ("insole-frame", "insole-35", 10)


def test_described_lines_name_their_layout_cells_and_foot() -> None:
    match = recognise(b"".join(b"%d;%d;R;0;1;2;3;4;5;6;7;8\r\n" % (10 * n, n) for n in range(20)))
    assert match is not None
    assert (match.format_name, match.layout, match.cells) == ("insole-csv", "insole-8", 8)
    assert match.feet == ("right",)


def test_lines_of_numbers_with_a_foot_are_lines_of_an_insole_that_nobody_has_described() -> None:
    match = recognise(b"".join(b"%d,left,1.5,2.5\n" % n for n in range(20)))
    assert match is not None
    assert (match.format_name, match.layout) == ("insole-csv", None)


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_format(seed: int) -> None:
    assert recognise(random.Random(seed).randbytes(4000)) is None


def test_silence_and_a_banner_are_no_format() -> None:
    assert recognise(b"") is None
    assert recognise(b"ESP-ROM:esp32s3-20210327\r\nBuild:Mar 27 2021\r\nrst:0x1 (POWERON)\r\n" * 5) is None


def test_noisy_line_is_still_recognised_and_its_share_says_so() -> None:
    chance, data = random.Random(1), bytearray(streams()["bno08x-rvc"])
    for _ in range(12):
        data[chance.randrange(len(data))] ^= 0xFF
    match = recognise(bytes(data))
    assert match is not None
    assert match.format_name == "bno08x-rvc"
    assert 0.6 < match.share < 1.0


def test_a_format_without_its_test_is_told_what_to_write() -> None:
    with pytest.raises(
        pytest.UsageError, match=r"write tests/unit/imu/test_my_own\.py with STREAM: docs/how-to"
    ):
        stream_of("imu", "my-own")
