"""Homing in the dialogue: offered, told, begun on the one phrase only, and the zero is true afterwards."""

import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.bus.settings import CanSettings
from drivers.joint import power as drive_power
from gateway.commission import homing_run, power
from gateway.commission.axes import Axis
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft
from gateway.commission.homing import homing
from gateway.commission.powered_run import NotStopped
from gateway.commission.scale import Scale
from tests.unit.commission.fake_bench import Hands
from tests.unit.commission.homing_drive import COMPLETE, FAILED, UNDER_WAY, HomingDrive, encoded
from tests.unit.joint.standard import S

KNEE, NODE, AXIS = "left_knee", 5, Axis(5)
TURN = 409_600
SCALE = Scale(4096.0, 100.0, 1, 0.0)


class Keeper(Hands):
    """Watches what moves, and presses STOP when told to."""

    def __init__(self, *does: tuple[str, Callable[[], str]], stop: bool = False) -> None:
        super().__init__(*does)
        self._stop = stop

    def moving(self, text: str) -> str:
        if not self.heard(text):
            self.read.append(text)
        return "STOP was pressed" if self._stop and "looks for home" in text else ""


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(power, "LISTEN_S", 0.02)
    monkeypatch.setattr(drive_power, "RESET_S", 0.3)
    monkeypatch.setattr(homing_run, "SETTLED_S", 0.02)


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    made = Draft(tmp_path / "exo-01.toml")
    made.put(f"node.{NODE}", "eds", "joint_drive.eds")
    for key, value in (("counts_per_revolution", 4096.0), ("gear_ratio", 100.0), ("direction", 1)):
        made.put(f"joint.{KNEE}", key, value)
    made.put(f"joint.{KNEE}", "zero_offset", 0.0, "rad; by hand")
    for key, told in (("ends", [-0.5, 1.5]), ("rated_current", 5.0), ("rated_torque", 40.0)):
        made.put(f"told.{KNEE}", key, told)
    return made


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[CanBench]:
    made = CanBench("main", CanSettings(interface="virtual", channel=str(request.node.nodeid)))
    yield made
    made.close()


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


def saying(typed: str) -> Callable[[], str]:
    return lambda: typed


def beginning(method: int, *more: tuple[str, Callable[[], str]]) -> tuple[tuple[str, Callable[[], str]], ...]:
    return (
        ("find its own zero", saying(str(method))),
        ("How fast may", saying("5")),
        ("is to get power", saying("")),
        ("Type  home", saying(f"home {KNEE}")),
        *more,
    )


def zero(draft: Draft) -> float:
    return float(Draft(draft.file).value(f"joint.{KNEE}", "zero_offset", math.nan))


def test_what_moves_nothing_is_offered_first_and_gives_the_drive_a_new_zero(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE) as drive:
        drive.objects[0x6064, 0] = encoded(0x6064, TURN // 8)  # it stands at 45°
        hands = Keeper(*beginning(37))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands)
        assert drive.state is S.SWITCH_ON_DISABLED
    offer = next(line for line in hands.read if "find its own zero" in line)
    assert offer.index("37:") < offer.index("35:") < offer.index("17:")
    assert hands.heard("more than half a degree ends it")
    assert zero(draft) == pytest.approx(math.pi / 4, abs=1e-4)
    assert (
        "45.00° where it stood after homing by method 37" in draft.tables[f"joint.{KNEE}"]["zero_offset"].how
    )
    run(homing(draft, bench, KNEE, AXIS, SCALE), again := Keeper())
    assert again.read == []


def test_what_moves_is_told_with_its_ends_and_its_speed_and_its_zero_is_shown_by_hand_again(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, home=3000) as drive:
        hands = Keeper(*beginning(17, ("one known angle, without power", saying("30"))))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands)
        assert drive.objects[0x6099, 1] == encoded(0x6099, round(5 / 360 * TURN))
        assert drive.objects[0x6099, 2] == encoded(0x6099, round(1 / 360 * TURN))
    told = next(line for line in hands.read if "What will happen" in line)
    for words in (
        "left knee (node 5) alone",
        "from 0.0°",
        "-28.6° and 85.9°",
        "at 5°/s at most",
        "at most 200 %",
        "6007h",
    ):
        assert words in told
    assert hands.heard("stopped and disabled, as its statusword says")
    assert zero(draft) == pytest.approx(math.radians(30), abs=1e-4)


@pytest.mark.parametrize("typed", ["", "y", "yes", "home", "home right_knee", "HOME left_knee"])
def test_no_other_word_puts_it_under_power(draft: Draft, bench: CanBench, channel: str, typed: str) -> None:
    with HomingDrive(channel, NODE) as drive:
        does = [one for one in beginning(37) if "Type" not in one[0]]
        hands = Keeper(*does, ("Type  home", saying(typed)), ("find its own zero", saying("no")))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands)
        assert drive.words == []
        assert hands.heard("Nothing gets power")
    assert zero(draft) == 0.0


def test_who_presses_stop_shows_the_zero_again_because_it_may_be_another(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, home=None, step=1) as drive:
        does = beginning(17, ("one known angle, without", saying("0")), ("find its own zero", saying("no")))
        hands = Keeper(*does, stop=True)
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands)
        assert drive.state is S.SWITCH_ON_DISABLED
    assert hands.heard("Not homed: STOP was pressed; the drive is stopped and disabled")
    assert draft.value(f"told.{KNEE}", "homing") is None


def test_a_stop_while_it_listens_begins_nothing(draft: Draft, bench: CanBench, channel: str) -> None:
    class Hasty(Keeper):
        def moving(self, text: str) -> str:
            threading.Event().wait(0.3)  # long enough for a drive to be led up
            return "STOP was pressed"

    with HomingDrive(channel, NODE) as drive:
        hands = Hasty(*beginning(37), ("find its own zero", saying("no")))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands)
        assert drive.words == []
    assert hands.heard("Nothing got power: STOP was pressed")
    assert zero(draft) == 0.0


def test_a_drive_that_says_that_it_is_home_and_counts_as_before_is_shown_by_hand(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, homing=COMPLETE, begins=False) as drive:
        drive.objects[0x6064, 0] = encoded(0x6064, TURN // 8)
        does = beginning(37, ("one known angle, without power", saying("45")))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands := Keeper(*does))
    assert hands.heard("one known angle, without power")


def test_until_it_is_shown_again_there_is_no_zero_to_go_on_with(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    def fail(drive: HomingDrive) -> None:
        drive.homing = FAILED if drive.homing == UNDER_WAY else drive.homing

    with HomingDrive(channel, NODE, on_look=fail), pytest.raises(EOFError):
        run(homing(draft, bench, KNEE, AXIS, SCALE), Keeper(*beginning(17)))
    assert math.isnan(zero(draft))


def test_a_drive_that_does_not_confirm_that_it_is_off_ends_everything(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    deaf = {0x0000, 0x0002}
    with (
        HomingDrive(channel, NODE, home=None, step=1, deaf_to_words=deaf),
        pytest.raises(NotStopped, match="NOT confirmed"),
    ):
        run(homing(draft, bench, KNEE, AXIS, SCALE), Keeper(*beginning(17), stop=True))


def test_a_drive_that_would_go_on_is_given_another_6007h_on_word_only(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, objects={(0x6007, 0): bytes(2)}) as drive:
        run(homing(draft, bench, KNEE, AXIS, SCALE), Keeper(*beginning(37, ("Write 6007h", saying("n")))))
        assert (drive.words, drive.objects[0x6007, 0]) == ([], bytes(2))
        draft.forget(f"told.{KNEE}", "homing")
        run(homing(draft, bench, KNEE, AXIS, SCALE), Keeper(*beginning(37, ("Write 6007h", saying("y")))))
        assert drive.objects[0x6007, 0] == b"\x03\x00"
        assert 0x1F in drive.words


@pytest.mark.parametrize(
    ("objects", "told", "words"),
    [
        ({}, "rated_current", "its rated current is not known"),
        ({(0x6073, 0): bytes(2)}, None, "no limit of current or torque"),
        ({(0x1016, 0): b"\x00"}, None, "cannot watch our heartbeat"),
        ({(0x6007, 0): b"\xff\xff"}, None, "6007h is the vendor's own (-1)"),
    ],
)
def test_what_is_not_known_gets_no_power(
    draft: Draft,
    bench: CanBench,
    channel: str,
    objects: dict[tuple[int, int], bytes],
    told: str | None,
    words: str,
) -> None:
    if told is not None:
        draft.forget(f"told.{KNEE}", told)
    with HomingDrive(channel, NODE, objects=objects) as drive:
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands := Keeper(*beginning(37)))
        assert drive.words == []
    assert hands.heard(words)


def test_a_joint_whose_position_is_not_told_gets_no_power(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, aborts={(0x6064, 0): 0x0602_0000}) as drive:
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands := Keeper(*beginning(37)))
        assert drive.words == []
    assert hands.heard("its drive tells no position (6064h)")


def test_without_ends_by_hand_only_what_moves_nothing_is_offered(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    draft.forget(f"told.{KNEE}", "ends")
    with HomingDrive(channel, NODE):
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands := Keeper(("find its own zero", saying("no"))))
    assert not hands.heard("17:")


def test_a_speed_in_a_unit_that_nobody_knows_is_not_set(draft: Draft, bench: CanBench, channel: str) -> None:
    objects = {(0x60A9, 0): (0x1234_5678).to_bytes(4, "little")}
    with HomingDrive(channel, NODE, objects=objects) as drive:
        does = (*beginning(17), ("find its own zero", saying("no")))
        run(homing(draft, bench, KNEE, AXIS, SCALE), hands := Keeper(*does))
        assert drive.words == []
    assert hands.heard("Its speeds cannot be set")


@pytest.mark.parametrize(("choice", "finished"), [("no", False), ("37", True)])
def test_a_drive_whose_zero_is_turns_away_is_mended_by_homing_where_it_is(
    draft: Draft, bench: CanBench, channel: str, choice: str, finished: bool
) -> None:
    draft.put(f"joint.{KNEE}", "zero_offset", 3 * math.tau)
    far = Scale(4096.0, 100.0, 1, 3 * math.tau)
    with HomingDrive(channel, NODE) as drive:
        drive.objects[0x6064, 0] = encoded(0x6064, -3 * TURN)
        does = beginning(37)[2:] if finished else ()
        run(homing(draft, bench, KNEE, AXIS, far), Keeper(("find its own zero", saying(choice)), *does))
    assert draft.has(f"joint.{KNEE}", "zero_offset") is finished
    assert draft.value(f"joint.{KNEE}", "zero_offset", 0.0) == pytest.approx(0.0, abs=1e-4)
