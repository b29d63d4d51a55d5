"""Ways through a drive's states: down from any, up one transition at a time, both ended by a stop."""

import pytest

from drivers.bus.sdo_channel import Interrupted
from drivers.joint.cia402 import DriveState
from drivers.joint.leading import OVERTAKEN, Errand, Led, lead_down, step_up
from tests.unit.joint.sdo_drive import SdoDrive
from tests.unit.joint.standard import LEAVES_BY_ITSELF, S

ERRAND = Errand(lambda: True, timeout_s=0.3, counts_per_turn=409_600)
PATIENT = Errand(lambda: True, timeout_s=20.0, counts_per_turn=409_600)
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
        assert lead_down(drive.axis, ERRAND) == Led(S.FAULT, "it stays in fault")
        assert drive.controlwords.count(0x0080) == 1

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

    def test_a_stop_that_has_come_already_lets_nothing_be_sent(self) -> None:
        drive = SdoDrive(S.SWITCH_ON_DISABLED)
        led = step_up(drive.axis, Errand(lambda: False, 20.0, 409_600), S.SWITCH_ON_DISABLED)
        assert led.problem == OVERTAKEN
        assert drive.written == []

    def test_what_was_interrupted_ends_and_is_not_begun_again(self) -> None:
        drive = SdoDrive(S.SWITCH_ON_DISABLED)

        def interrupt(_index: int) -> None:
            raise Interrupted

        drive.on_request = interrupt
        assert step_up(drive.axis, PATIENT, S.SWITCH_ON_DISABLED) == Led(None, OVERTAKEN)
