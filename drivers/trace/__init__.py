"""A bus, frame by frame, in the words of the standards and of the devices' EDS files. It never sends."""
