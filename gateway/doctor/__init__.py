"""The doctor: what is wrong with a robot, by its file, its buses, its sensors and its computer."""
