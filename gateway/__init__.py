"""The robot side: on-demand daemon, its modules, its client."""

__version__ = "0.1.0"  # of the whole package; looking it up in the installation would cost the robot 2 MB
