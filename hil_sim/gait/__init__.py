"""How the wearer moves: joint angles, load on the feet, trunk."""
