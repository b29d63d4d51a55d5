"""Ways through a drive's states: down from any, up one transition at a time, both ended by a stop."""

import time

import pytest

from drivers.bus.sdo.channel import Interrupted
from drivers.error_codes import error_check, error_text
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import WAY_UP
from drivers.joint.transitions import OVERTAKEN, Errand, Led, lead_down, look, step_up
from tests.unit.joint.sdo_drive import SdoDrive
from tests.unit.joint.standard import LEAVES_BY_ITSELF, S

ERRAND = Errand(lambda: True, timeout_s=0.3, counts_per_turn=409_600)
PATIENT = Errand(lambda: True, timeout_s=20.0, counts_per_turn=409_600)
NO_CODE = "it tells no code; remove what causes it, then reset it again"
SENT_DOWN = {0x0000, 0x0002, 0x0080}


class TestDown:
    @pytest.mark.parametrize("stays", [True, False])
    @pytest.mark.parametrize("state", [state for state in S if state not in LEAVES_BY_ITSELF])
    def test_every_state_leads_to_switch_on_disabled_and_never_through_operation(
        self, state: DriveState, stays: bool
    ) -> None:
        drive = SdoDrive(state, stays=stays)
        assert lead_down(drive.axis, PATIENT) == Led(S.SWITCH_ON_DISABLED)
        assert S.OPERATION_ENABLED not in drive.states[1:]
        assert set(drive.controlwords) <= SENT_DOWN

    def test_an_enabled_drive_brakes_before_its_current_goes(self) -> None:
        drive = SdoDrive(S.OPERATION_ENABLED)
        lead_down(drive.axis, PATIENT)
        assert drive.states == [S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE, S.SWITCH_ON_DISABLED]
        assert drive.controlwords == [0x0002, 0x0000]

    def test_a_drive_that_still_moves_is_not_let_go_limp(self) -> None:
        drive = SdoDrive(S.QUICK_STOP_ACTIVE)
        looks = 0

        def moves(index: int) -> None:
            nonlocal looks
            if index == 0x6064:
                looks += 1
                drive.values[0x6064, 0] = (1000 * min(looks, 8)).to_bytes(4, "little")

        drive.on_request = moves
        assert lead_down(drive.axis, PATIENT).problem is None
        assert looks > 8

    def test_a_fault_is_reset_by_a_rising_edge_of_bit_7_and_nothing_else(self) -> None:
        drive = SdoDrive(S.FAULT)  # as if the controlword had been 0080h before
        lead_down(drive.axis, PATIENT)
        assert drive.controlwords == [0x0000, 0x0080, 0x0000]

    def test_a_fault_that_stays_is_told_and_not_reset_again_and_again(self) -> None:
        drive = SdoDrive(S.FAULT)
        drive.deaf_to = {0x0080}
        led = lead_down(drive.axis, ERRAND)
        assert led == Led(S.FAULT, f"it stays in fault: {NO_CODE}")
        assert drive.controlwords.count(0x0080) == 1

    def test_a_fault_that_stays_is_told_with_its_code_and_what_to_do(self) -> None:
        drive = SdoDrive(S.FAULT)
        drive.deaf_to = {0x0080}
        drive.values[0x603F, 0] = (0x4310).to_bytes(2, "little")
        told = lead_down(drive.axis, ERRAND).problem or ""
        assert told.startswith(f"it stays in fault: {error_text(0x4310)}; ")
        assert error_check(0x4310) in told
        assert told.endswith(", then reset it again")

    @pytest.mark.parametrize("state", LEAVES_BY_ITSELF)
    def test_what_a_drive_leaves_by_itself_is_waited_for(self, state: DriveState) -> None:
        drive = SdoDrive(state)
        assert lead_down(drive.axis, ERRAND) == Led(state, f"it stays in {state.words}")
        assert drive.controlwords == []

    def test_a_drive_that_refuses_says_why(self) -> None:
        drive = SdoDrive(S.SWITCHED_ON)
        drive.aborts[0x6040] = 0x0800_0022
        led = lead_down(drive.axis, ERRAND)
        assert led.state is S.SWITCHED_ON
        assert "0x6040" in str(led.problem)

    def test_what_it_found_carries_when_that_was_asked(self) -> None:
        drive = SdoDrive(S.SWITCHED_ON)
        commanded_ns = 0

        def note(index: int) -> None:
            nonlocal commanded_ns
            commanded_ns = time.monotonic_ns() if index == 0x6040 else commanded_ns

        drive.on_request = note
        led = lead_down(drive.axis, PATIENT)
        assert commanded_ns < led.asked_ns < time.monotonic_ns()

    def test_a_stop_that_comes_while_it_looks_whether_it_stands_leaves_it_its_current(self) -> None:
        drive, wanted = SdoDrive(S.QUICK_STOP_ACTIVE), True

        def stop(index: int) -> None:
            nonlocal wanted
            wanted = index != 0x6064

        drive.on_request = stop
        led = lead_down(drive.axis, Errand(lambda: wanted, 20.0, 409_600))
        assert (led.state, led.problem) == (S.QUICK_STOP_ACTIVE, OVERTAKEN)
        assert drive.controlwords == []

    @pytest.mark.parametrize("state", [S.SWITCH_ON_DISABLED, S.SWITCHED_ON])
    def test_a_stop_that_comes_with_the_last_look_is_told(self, state: DriveState) -> None:
        drive, wanted = SdoDrive(state), True

        def stop(index: int) -> None:
            nonlocal wanted
            wanted = wanted and not (index == 0x6041 and drive.state is S.SWITCH_ON_DISABLED)

        drive.on_request = stop
        led = lead_down(drive.axis, Errand(lambda: wanted, 20.0, 409_600))
        assert (led.state, led.problem) == (S.SWITCH_ON_DISABLED, OVERTAKEN)

    def test_a_stop_between_two_commands_ends_it(self) -> None:
        drive, wanted = SdoDrive(S.FAULT), True
        drive.deaf_to = {0x0080}

        def stop(index: int) -> None:
            nonlocal wanted
            wanted = wanted and index != 0x6040

        drive.on_request = stop
        assert lead_down(drive.axis, Errand(lambda: wanted, 20.0, 409_600)) == Led(S.FAULT, OVERTAKEN)
        assert drive.controlwords == [0x0000]

    def test_a_stop_ends_it(self) -> None:
        drive = SdoDrive(S.OPERATION_ENABLED)
        wanted = True

        def stop(index: int) -> None:
            nonlocal wanted
            wanted = index != 0x6040

        drive.on_request = stop
        led = lead_down(drive.axis, Errand(lambda: wanted, 20.0, 409_600))
        assert led.problem == OVERTAKEN
        assert drive.controlwords == [0x0002]


class TestUp:
    def test_each_step_is_one_transition(self) -> None:
        drive = SdoDrive(S.SWITCH_ON_DISABLED)
        for origin, target in (
            (S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON),
            (S.READY_TO_SWITCH_ON, S.SWITCHED_ON),
            (S.SWITCHED_ON, S.OPERATION_ENABLED),
        ):
            led = step_up(drive.axis, PATIENT, origin)
            assert (led.state, led.problem) == (target, None)
        assert drive.controlwords == [0x0006, 0x0007, 0x000F]

    @pytest.mark.parametrize(
        ("origin", "states"),
        [
            (
                S.SWITCH_ON_DISABLED,
                [S.FAULT, S.QUICK_STOP_ACTIVE, S.NOT_READY_TO_SWITCH_ON, S.FAULT_REACTION_ACTIVE],
            ),
            (S.READY_TO_SWITCH_ON, [S.SWITCH_ON_DISABLED, S.FAULT, S.QUICK_STOP_ACTIVE]),
            (S.SWITCHED_ON, [S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.FAULT, S.QUICK_STOP_ACTIVE]),
        ],
    )
    def test_nothing_is_sent_from_any_other_state(self, origin: DriveState, states: list[DriveState]) -> None:
        for state in states:
            drive = SdoDrive(state)
            led = step_up(drive.axis, PATIENT, origin)
            assert (led.state, led.problem) == (state, f"it is not in {origin.words}; reset it first")
            assert drive.written == []

    def test_a_drive_that_is_further_up_is_left_as_it_is(self) -> None:
        drive = SdoDrive(S.OPERATION_ENABLED)
        assert step_up(drive.axis, PATIENT, S.SWITCHED_ON) == Led(S.OPERATION_ENABLED)
        assert drive.written == []

    @pytest.mark.parametrize(
        ("mode", "setpoint"),
        [
            (1, (0x607A, 0, (1234).to_bytes(4, "little"))),
            (8, (0x607A, 0, (1234).to_bytes(4, "little"))),
            (3, (0x60FF, 0, bytes(4))),
            (10, (0x6071, 0, bytes(2))),
        ],
    )
    def test_before_it_is_enabled_the_setpoint_moves_nothing(
        self, mode: int, setpoint: tuple[int, int, bytes]
    ) -> None:
        drive = SdoDrive(S.SWITCHED_ON, mode=mode)
        assert step_up(drive.axis, PATIENT, S.SWITCHED_ON) == Led(S.OPERATION_ENABLED, mode=mode)
        assert drive.written == [setpoint, (0x6040, 0, b"\x0f\x00")]

    @pytest.mark.parametrize(
        ("mode", "zeroed"),
        [(1, []), (7, []), (8, [0x60B0, 0x60B1, 0x60B2]), (9, [0x60B1, 0x60B2]), (10, [0x60B2])],
    )
    def test_before_it_is_enabled_nothing_is_added_to_its_setpoint(
        self, mode: int, zeroed: list[int]
    ) -> None:
        drive = SdoDrive(S.SWITCHED_ON, mode=mode)
        left = {
            0x60B0: (500).to_bytes(4, "little"),
            0x60B1: (-1 % 2**32).to_bytes(4, "little"),
            0x60B2: b"\x64\x00",
        }
        drive.values |= {(index, 0): value for index, value in left.items()} | {(0x60C1, 1): bytes(4)}
        assert step_up(drive.axis, PATIENT, S.SWITCHED_ON) == Led(S.OPERATION_ENABLED, mode=mode)
        for index, value in left.items():
            assert drive.values[index, 0] == (bytes(len(value)) if index in zeroed else value)
        assert drive.written[-1] == (0x6040, 0, b"\x0f\x00")

    @pytest.mark.parametrize(
        ("mode", "index"), [(8, 0x60B0), (8, 0x60B1), (8, 0x60B2), (9, 0x60B1), (10, 0x60B2)]
    )
    def test_an_offset_that_stays_or_is_not_told_is_not_enabled(self, mode: int, index: int) -> None:
        for refusal in (None, 0x0601_0002, 0x0800_0022):
            drive = SdoDrive(S.SWITCHED_ON, mode=mode)
            drive.values[index, 0] = b"\x01\x00\x00\x00"
            drive.stuck.add(index)
            drive.aborts |= {} if refusal is None else {index: refusal}
            led = step_up(drive.axis, PATIENT, S.SWITCHED_ON)
            assert f"0x{index:04X}" in str(led.problem)
            assert drive.controlwords == []

    @pytest.mark.parametrize("mode", [0, 6, 0x80])
    def test_a_mode_of_which_nobody_knows_what_it_would_do_is_not_enabled(self, mode: int) -> None:
        drive = SdoDrive(S.SWITCHED_ON, mode=mode)
        led = step_up(drive.axis, PATIENT, S.SWITCHED_ON)
        assert "6060h" in str(led.problem)
        assert drive.written == []

    def test_a_setpoint_that_is_not_taken_is_not_enabled(self) -> None:
        drive = SdoDrive(S.SWITCHED_ON)

        def another(index: int) -> None:
            if index == 0x607A and drive.written:
                drive.values[0x607A, 0] = (9).to_bytes(4, "little")

        drive.on_request = another
        assert "would move it" in str(step_up(drive.axis, PATIENT, S.SWITCHED_ON).problem)
        assert drive.controlwords == []

    def test_a_drive_that_falls_back_while_it_is_prepared_is_not_enabled_in_two_steps(self) -> None:
        """Some take "enable operation" in ready to switch on as two transitions in one."""
        drive = SdoDrive(S.SWITCHED_ON)
        drive.on_request = lambda index: drive.go(S.READY_TO_SWITCH_ON) if index == 0x607A else None
        led = step_up(drive.axis, PATIENT, S.SWITCHED_ON)
        assert led.state is S.READY_TO_SWITCH_ON
        assert drive.controlwords == []

    def test_a_drive_that_does_not_follow_says_where_it_stayed(self) -> None:
        drive = SdoDrive(S.READY_TO_SWITCH_ON)
        drive.deaf_to = {0x0007}
        led = step_up(drive.axis, ERRAND, S.READY_TO_SWITCH_ON)
        assert led == Led(S.READY_TO_SWITCH_ON, "it did not go from ready to switch on to switched on")

    @pytest.mark.parametrize("origin", WAY_UP)
    def test_a_stop_that_has_come_already_lets_nothing_be_sent(self, origin: DriveState) -> None:
        drive = SdoDrive(origin)
        led = step_up(drive.axis, Errand(lambda: False, 20.0, 409_600), origin)
        assert led.problem == OVERTAKEN
        assert drive.written == []

    @pytest.mark.parametrize("last", [0x6041, 0x60FF, 0x6040])
    @pytest.mark.parametrize("follows", [True, False])
    def test_a_stop_that_comes_meanwhile_is_told_wherever_the_drive_is_then(
        self, last: int, follows: bool
    ) -> None:
        drive, wanted = SdoDrive(S.SWITCHED_ON, mode=3), True
        drive.deaf_to = set() if follows else {0x000F}

        def stop(index: int) -> None:
            nonlocal wanted
            wanted = wanted and index != last

        drive.on_request = stop
        led = step_up(drive.axis, Errand(lambda: wanted, 20.0, 409_600), S.SWITCHED_ON)
        assert led.problem == OVERTAKEN
        assert drive.controlwords == ([0x000F] if last == 0x6040 else [])

    def test_a_drive_that_is_up_already_when_a_stop_comes_is_overtaken_too(self) -> None:
        drive, wanted = SdoDrive(S.OPERATION_ENABLED), True

        def stop(_index: int) -> None:
            nonlocal wanted
            wanted = False

        drive.on_request = stop
        led = step_up(drive.axis, Errand(lambda: wanted, 20.0, 409_600), S.SWITCHED_ON)
        assert (led.state, led.problem) == (S.OPERATION_ENABLED, OVERTAKEN)

    def test_what_was_interrupted_ends_and_is_not_begun_again(self) -> None:
        drive = SdoDrive(S.SWITCH_ON_DISABLED)

        def interrupt(_index: int) -> None:
            raise Interrupted

        drive.on_request = interrupt
        assert step_up(drive.axis, PATIENT, S.SWITCH_ON_DISABLED) == Led(None, OVERTAKEN)


class TestLook:
    @pytest.mark.parametrize("state", S)
    def test_one_read_says_the_state_and_when_it_was_asked(self, state: DriveState) -> None:
        drive = SdoDrive(state)
        requests: list[int] = []
        drive.on_request = requests.append
        before_ns = time.monotonic_ns()
        led = look(drive.axis)
        assert led == Led(state)
        assert before_ns <= led.asked_ns <= time.monotonic_ns()
        assert requests == [0x6041]

    def test_what_cannot_be_read_says_why(self) -> None:
        drive = SdoDrive(S.FAULT)
        drive.aborts[0x6041] = 0x0800_0022
        led = look(drive.axis)
        assert (led.state, led.asked_ns) == (None, 0)
        assert "0x6041" in str(led.problem)
