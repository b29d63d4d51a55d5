"""The pages Resources and Bus: the robot's computer and its CAN buses over time."""
