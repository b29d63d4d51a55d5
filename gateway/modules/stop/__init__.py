"""The stop: quick stop on every drive, held until it is reset; reset, and enabling as the bus's master."""
