"""The head of a robot's journal as the robot has signed it: looked at before it is kept as a witness."""

import asyncio

from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.client import Address, Client, RemoteError
from gateway.client.keys import pin_of
from gateway.records.witness import objection
from gateway.wire.control import SignedHead
from server_gui.core.follow.validation import Unfit


async def signed_head(client: Client, address: Address) -> SignedHead | None:
    """Return the newest entry, signed; `None` where the robot has no key, or is from before there were any.

    Raises:
        Unfit: it was signed by another key than was paired, or its signature does not hold.
        KeyProblem: nobody can say, because this computer has no program to do it.

    """
    try:
        head = (await client.journal_head()).head
    except RemoteError:
        return None
    problem = None if head is None else await asyncio.to_thread(_objection, head, address)
    if problem is not None:
        raise Unfit(problem)
    return head


def _objection(head: SignedHead, address: Address) -> str | None:
    """Return the objection to a robot's key; an unpaired robot on this computer may have any."""
    try:
        key = pin_of(address) or fingerprint(der_of(head.certificate.encode("ascii", "replace")))
    except KeyProblem as error:
        return f"what it calls its certificate: {error}"
    return objection(head, key)
