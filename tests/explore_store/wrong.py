"""What a play must not end in."""


class Wrong(AssertionError):
    """Something that was acknowledged is lost, doubled or misnamed, and no event tells of it."""


def sentence(what: str, *found: object) -> str:
    """What is wrong, and what was found instead."""
    return ": ".join([what, *map(str, found)])
