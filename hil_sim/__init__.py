"""A whole exoskeleton without hardware, spoken from the standards and manuals."""
