"""The gait controller of the simulated robot: master of the bus, leader of the drives."""

from hil_sim.controller.gait_controller import GaitController
from hil_sim.controller.objects import ACTIVITY, COMMAND, CYCLE_TIME, STEP_LENGTH, ControllerState

__all__ = ["ACTIVITY", "COMMAND", "CYCLE_TIME", "STEP_LENGTH", "ControllerState", "GaitController"]
