"""The commands of the robot side: one file a command, what they share in `connect` and `text`."""
