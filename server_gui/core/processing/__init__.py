"""Values derived from a robot's: gait, units, resources, the link. Live and over recordings alike."""
