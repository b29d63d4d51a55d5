"""What is made of a robot's values: gait, units, resources, the link. Live and over recordings alike."""
