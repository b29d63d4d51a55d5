"""Processing: gait, units, resources and the link."""
