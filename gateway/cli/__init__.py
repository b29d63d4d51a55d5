"""The commands of the robot side: one file for serving, one for asking."""
