"""The trunk IMUs: a file each, whose IMUS are its languages by name."""
