"""The resource module: CPU, memory, processes and the control loop of the robot's computer."""
