"""Roles of clients on a robot: three, each with all permissions of those before it."""

from enum import StrEnum


class Role(StrEnum):
    """Role of a person or program; every role may stop."""

    VIEWER = "viewer"  # looks, and stops
    OPERATOR = "operator"  # takes the lease, writes, tries
    MAINTAINER = "maintainer"  # stores, restores, resets, enables, takes a lease over

    def includes(self, other: "Role") -> bool:
        """Return whether this role may do what that one may."""
        return _RANKS[self] >= _RANKS[other]


_RANKS = {role: rank for rank, role in enumerate(Role)}
