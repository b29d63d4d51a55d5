"""A CiA 402 joint drive with its motor, gear and joint."""
