"""Hardware in, typed samples out: joints, insoles, IMUs, and the bus and port they share."""
