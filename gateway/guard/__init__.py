"""The guard: an always-on watch that a robot's file may ask for, and that stops the drives on its own."""
