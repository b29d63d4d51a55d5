"""An attack on a daemon at rest: it is woken up and left alone a thousand times."""

ATTACKS = ()
