"""One-time tickets with which a browser's page opens a websocket, since it cannot send a header with the handshake.

A ticket is its expiry and a random number, signed (HMAC-SHA-256) with a key that is made of the read tokens: every
server process of one site accepts it, wherever it was issued. Each process remembers the tickets that it has taken
until each of them expires, as long as whoever issued it has given it, so that none opens two streams there; that a
ticket seen on its way is worth nothing elsewhere either follows from its life of seconds. No sockets and no clock of
its own (Sans-I/O). Time never goes back here: a clock that does makes no ticket good again that had expired.

===========  =====  ==============================================
bytes        type   content
===========  =====  ==============================================
0-7          >u8    expiry, milliseconds since 1970
8-23         bytes  random
24-55        bytes  HMAC of the bytes before
===========  =====  ==============================================
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import secrets
import struct
from heapq import heappop, heappush
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

_EXPIRY = struct.Struct(">Q")
_RANDOM_BYTES = 16
_SIGNED_BYTES = _EXPIRY.size + _RANDOM_BYTES
LONGEST_LIFE = 2 * 3600.0
"""Seconds: the longest that `ticket_seconds` may be set to, and as much for servers' clocks that do not agree."""
_TICKET_LETTERS = 75
"""56 bytes in base64 without padding."""
MOST_REMEMBERED = 100_000
"""Tickets taken and not yet expired; at 30 s that is 3000 new streams a second of one process."""


class TicketOffice:
    """Issues tickets and takes them back.

    Args:
        tokens: the read tokens, of which the key is made; without any, it is random.
        seconds: how long a ticket is good.
        clock: seconds since 1970.
        most: how many tickets are remembered; when there are more, none is taken until some expire.
    """

    def __init__(
        self, tokens: Iterable[str], *, seconds: float, clock: Callable[[], float], most: int = MOST_REMEMBERED
    ) -> None:
        given = "\n".join(sorted(tokens)).encode() or secrets.token_bytes(32)
        self._key = hmac.digest(b"meshtide websocket tickets", given, hashlib.sha256)
        self._seconds = seconds
        self._clock = clock
        self._most = most
        self._taken: set[bytes] = set()
        self._order: list[tuple[float, bytes]] = []
        """Those that were taken, as a heap: the one that expires first comes first."""
        self._latest = 0.0

    def issue(self) -> str:
        """A new ticket."""
        expiry = int(1000 * (self._now() + self._seconds))
        signed = _EXPIRY.pack(expiry) + secrets.token_bytes(_RANDOM_BYTES)
        return base64.urlsafe_b64encode(signed + self._signature(signed)).decode().rstrip("=")

    def take(self, ticket: str) -> bool:
        """Whether `ticket` is good; it is not a second time."""
        if len(ticket) != _TICKET_LETTERS:
            return False
        try:
            data = base64.b64decode(ticket + "=", altchars=b"-_", validate=True)
        except (ValueError, binascii.Error):
            return False
        signed = data[:_SIGNED_BYTES]
        if not hmac.compare_digest(self._signature(signed), data[_SIGNED_BYTES:]):
            return False
        now = self._now()
        self._forget(now)
        expiry = _EXPIRY.unpack_from(signed)[0] / 1000
        if not now < expiry <= now + LONGEST_LIFE or signed in self._taken or len(self._taken) >= self._most:
            return False
        self._taken.add(signed)
        heappush(self._order, (expiry, signed))
        return True

    def __repr__(self) -> str:
        return f"TicketOffice({len(self._taken)} taken)"

    def _now(self) -> float:
        self._latest = max(self._latest, self._clock())
        return self._latest

    def _signature(self, signed: bytes) -> bytes:
        return hmac.digest(self._key, signed, hashlib.sha256)

    def _forget(self, now: float) -> None:
        """Let go of tickets that have expired, and are good for nothing even if they are shown again."""
        while self._order and self._order[0][0] <= now:
            self._taken.discard(heappop(self._order)[1])
