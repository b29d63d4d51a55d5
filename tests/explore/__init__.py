"""Every interleaving tried: the gateway's real modules over a virtual clock, two buses, a disk and a loop."""
