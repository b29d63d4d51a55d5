"""Insoles on pseudo-terminals: values, both feet on one port, and what is wrong in words."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.component import Component, ComponentKind
from drivers.errors import SettingsError
from drivers.insole import layout as layouts
from drivers.insole.build import insoles
from drivers.insole.device import Insole
from drivers.insole.settings import InsoleSettings
from drivers.latest import Latest
from drivers.samples import Channel, ComponentState, Quality
from tests.support.waiting import until
from tests.unit.insole.encode import CALIBRATED, MISSING, RIGHT, Sender, cobs_frame
from tests.unit.port.terminals import Terminal, send_until

LOADED = [200] * 16  # 20 kPa everywhere


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    terminal = Terminal(tmp_path / "insole")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


@pytest.fixture
def insole(terminal: Terminal) -> Iterator[Insole]:
    insole = Insole("left_insole", InsoleSettings(port=str(terminal.path)))
    insole.start()
    yield insole
    insole.stop()


def values(insole: Insole) -> dict[str, float | None]:
    now_ns = insole.latest.updated_ns or 0
    return {
        channel.quantity: insole.latest.read(index, now_ns)[0]
        for index, channel in enumerate(insole.channels)
    }


def quality(insole: Insole) -> Quality:
    return insole.quality(time.monotonic_ns())


@pytest.fixture
def sender() -> Sender:
    return Sender()


def send(terminal: Terminal, insole: Insole, frame: Callable[[], bytes]) -> None:
    """Send frames until the insole has taken one."""
    before = insole.latest.updated_ns
    until(lambda: insole.line.problem(time.monotonic_ns()) is None, "the port to open")
    send_until(terminal, frame, lambda: insole.latest.updated_ns != before, "a sample")


def test_channels_are_force_cop_and_cells_in_si(insole: Insole) -> None:
    component: Component = insole
    assert component.kind is ComponentKind.INSOLE
    assert [(channel.name, channel.unit) for channel in component.channels[:4]] == [
        ("left_insole.force", "N"),
        ("left_insole.cop_x", "m"),
        ("left_insole.cop_y", "m"),
        ("left_insole.cell_0", "Pa"),
    ]
    assert len(component.channels) == 21


def test_even_pressure_gives_the_whole_soles_force_at_its_centre(
    insole: Insole, terminal: Terminal, sender: Sender
) -> None:
    send(terminal, insole, lambda: sender.frame(LOADED))
    got, layout = values(insole), layouts.load("insole-16")
    area = sum(layout.areas)
    assert got["cell_7"] == pytest.approx(20_000.0)
    assert got["force"] == pytest.approx(20_000.0 * area)
    assert got["cop_x"] == pytest.approx(sum(layout.moments_x) / area)
    assert quality(insole).state is ComponentState.OK


def test_foot_in_the_air_has_no_centre_of_pressure(
    insole: Insole, terminal: Terminal, sender: Sender
) -> None:
    send(terminal, insole, lambda: sender.frame([1] * 16))
    got = values(insole)
    assert got["force"] == pytest.approx(100.0 * sum(layouts.load("insole-16").areas))
    assert (got["cop_x"], got["cop_y"]) == (None, None)


def test_missing_cells_are_a_fault_and_null(insole: Insole, terminal: Terminal, sender: Sender) -> None:
    send(terminal, insole, lambda: sender.frame([200] * 15 + [0xFFFF], CALIBRATED | MISSING))
    got = values(insole)
    assert (got["cell_15"], got["force"]) == (None, None)
    assert got["cell_0"] == pytest.approx(20_000.0)
    assert quality(insole).state is ComponentState.FAULT
    assert "missing cells" in str(quality(insole).problem)


def test_counts_without_a_calibration_are_no_pressure(
    insole: Insole, terminal: Terminal, sender: Sender
) -> None:
    send(terminal, insole, lambda: sender.frame(LOADED, 0))
    assert set(values(insole).values()) == {None}
    assert quality(insole).state is ComponentState.FAULT
    assert "no calibration" in str(quality(insole).problem)


def test_other_number_of_cells_is_named(insole: Insole, terminal: Terminal, sender: Sender) -> None:
    send(terminal, insole, lambda: sender.frame([200] * 8))
    assert set(values(insole).values()) == {None}
    assert "sends 8 cells and the layout insole-16 has 16" in str(quality(insole).problem)


def test_swapped_ports_are_named(insole: Insole, terminal: Terminal, sender: Sender) -> None:
    send_until(
        terminal,
        lambda: sender.frame(LOADED, CALIBRATED | RIGHT),
        lambda: "swapped" in str(quality(insole).problem),
        "the words",
    )
    assert quality(insole).state is ComponentState.LOST
    assert set(values(insole).values()) == {None}


def test_late_frame_changes_nothing(insole: Insole, terminal: Terminal, sender: Sender) -> None:
    send(terminal, insole, lambda: sender.frame(LOADED))
    terminal.send(cobs_frame([0] * 16, sequence=sender.sequence - 1))
    until(lambda: quality(insole).counters["out_of_order"] > 0, "the late frame")
    assert values(insole)["cell_0"] == pytest.approx(20_000.0)


def test_both_feet_on_one_port_share_it_and_get_their_own_frames(terminal: Terminal, sender: Sender) -> None:
    settings = InsoleSettings(port=str(terminal.path))
    left, right = insoles({"left_insole": settings, "right_insole": settings})
    other = Sender()

    def both() -> bytes:
        return sender.frame(LOADED) + other.frame([100] * 16, CALIBRATED | RIGHT)

    assert left.line is right.line
    assert [y for _, y, _ in left.layout.cells] == [-y for _, y, _ in right.layout.cells]
    left.start()
    right.start()
    try:
        until(lambda: left.line.problem(time.monotonic_ns()) is None, "the port to open")
        send_until(
            terminal, both, lambda: None not in (left.latest.updated_ns, right.latest.updated_ns), "samples"
        )
        assert values(left)["cell_0"] == pytest.approx(20_000.0)
        assert values(right)["cell_0"] == pytest.approx(10_000.0)
        send_until(terminal, both, lambda: values(right)["load_share"] is not None, "the share")
        assert values(right)["load_share"] == pytest.approx(1 / 3)
        left.stop()
        before = right.latest.updated_ns
        send_until(terminal, both, lambda: right.latest.updated_ns != before, "the right foot alone")
        assert values(left)["cell_0"] is None
    finally:
        left.stop()
        right.stop()


def test_insoles_on_two_ports_do_not_share() -> None:
    left, right = insoles(
        {"left_insole": InsoleSettings(port="/dev/a"), "right_insole": InsoleSettings(port="/dev/b")}
    )
    assert left.line is not right.line


def test_calibration_file_turns_counts_into_pressure(
    terminal: Terminal, tmp_path: Path, sender: Sender
) -> None:
    (tmp_path / "left.toml").write_text(
        '[default]\npolarity = "falling"\nfull_scale = 4095\ngain = 10.0\nsaturation = 4000\n'
    )
    settings = InsoleSettings(port=str(terminal.path), calibration="left.toml")
    insole = Insole("left_insole", settings, beside=tmp_path)
    name, digest = insole.calibration.split()
    assert (name, len(digest)) == ("left.toml", 12)
    assert Insole("left_insole", InsoleSettings(port="-")).calibration == ""
    insole.start()
    try:
        send(terminal, insole, lambda: sender.frame([3095] * 15 + [0], 0))
        got = values(insole)
        assert got["cell_0"] == pytest.approx(10_000.0)
        assert got["cell_15"] == pytest.approx(40_950.0)
        assert got["contact"] == 1
        assert quality(insole).state is ComponentState.OK
        assert quality(insole).counters["saturated"] > 0
    finally:
        insole.stop()


def test_hip_of_the_same_leg_is_followed_by_its_velocity() -> None:
    insole = Insole("left_insole", InsoleSettings(port="-"))
    channels = [
        Channel(f"left_hip.{quantity}", "left_hip", quantity, "") for quantity in ("position", "velocity")
    ]
    hip = Latest("left_hip", channels, stale_after_s=0.5)
    insole.follow_hip(hip)
    hip.update(1000, (0, 1), (0.1, 2.5))
    if insole.hip_velocity is None:
        raise AssertionError("the hip is not followed")
    assert insole.hip_velocity(1000) == 2.5
    assert insole.hip_velocity(10**10) is None


def test_wrong_calibration_is_refused_when_the_robot_is_built(tmp_path: Path) -> None:
    (tmp_path / "left.toml").write_text("[cell.0]\ngain = 1.0\n")
    with pytest.raises(SettingsError, match="nothing of cell 1"):
        Insole("left_insole", InsoleSettings(port="-", calibration="left.toml"), beside=tmp_path)


def test_insole_format_that_needs_a_description_is_refused_without_one() -> None:
    with pytest.raises(SettingsError, match=r"table \[frame\]"):
        Insole("left_insole", InsoleSettings(port="-", format="insole-frame"))


def test_a_language_that_nobody_speaks_is_named() -> None:
    with pytest.raises(ValueError, match="format 'morse' is not known: allowed are brilliant-star, "):
        InsoleSettings(port="-", format="morse")
