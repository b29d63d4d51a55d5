"""Clients of a robot's gateway: `Client` for asyncio, `Robot` for blocking scripts.

connection (one TCP connection) → link (reconnection, clock, streams) → client (the methods) → blocking (a
thread).
"""

from gateway.client.address import Address
from gateway.client.blocking import Robot
from gateway.client.client import Client
from gateway.client.clock import ClockOffset
from gateway.client.errors import (
    NOTHING_SENT,
    BadAddress,
    CallTimeout,
    ClientError,
    LinkLost,
    NotConnected,
    NotPaired,
    ProtocolError,
    RemoteError,
    Unreachable,
    WrongRobot,
)
from gateway.client.link import ConnectionState, LinkSettings
from gateway.client.subscription import Batch, StreamCounters, Subscription

__all__ = [
    "NOTHING_SENT",
    "Address",
    "BadAddress",
    "Batch",
    "CallTimeout",
    "Client",
    "ClientError",
    "ClockOffset",
    "ConnectionState",
    "LinkLost",
    "LinkSettings",
    "NotConnected",
    "NotPaired",
    "ProtocolError",
    "RemoteError",
    "Robot",
    "StreamCounters",
    "Subscription",
    "Unreachable",
    "WrongRobot",
]
