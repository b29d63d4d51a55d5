"""Motion of the wearer: joint angles, load on the feet, trunk."""
