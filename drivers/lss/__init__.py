"""Layer setting services (CiA 305): who has no node id is found and given one, and bit rates are set."""
