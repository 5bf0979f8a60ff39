"""What one client may take of the server: connections at a time, bytes a second, requests that write a minute.

A client is an IPv4 address, or an IPv6 network of 64 bits, since that is what one subscriber is given. No sockets and
no clock of its own (Sans-I/O). What is known of a client is forgotten as soon as it says nothing, so that the table is
as large as the number of busy clients; when it is full all the same, newcomers share one entry.
"""

from __future__ import annotations

import ipaddress
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from meshtide_server.security.token_bucket import TokenBucket

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

MOST_CLIENTS = 50_000
SHARED = "(others)"
_SUBSCRIBER_BITS = 64
_PURGE_EVERY = 1024
"""Newcomers between two looks for entries that say nothing any more."""

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(slots=True)
class Client:
    """What one client has taken.

    Args:
        key: address or network.
        connections: how many are open.
        sending: bucket of the bytes sent to it, or None for no bound.
        writing: bucket of its requests that write, or None for no bound.
    """

    key: str
    connections: int = 0
    sending: TokenBucket | None = None
    writing: TokenBucket | None = None

    @property
    def idle(self) -> bool:
        """Whether forgetting it changes nothing."""
        return not self.connections and all(bucket is None or bucket.full for bucket in (self.sending, self.writing))


class ClientLimits:
    """The limits, and all busy clients.

    Args:
        connections: of one client at a time; 0 for no limit.
        bytes_per_second: sent to one client over all its connections; 0 for no limit.
        writes_per_minute: requests of one client that write; 0 for no limit.
        unlimited: networks to which none of this applies.
        clock: seconds, never going back.
        most: how many clients are counted apart.
    """

    def __init__(
        self,
        *,
        connections: int,
        bytes_per_second: int,
        writes_per_minute: int,
        unlimited: Iterable[Network],
        clock: Callable[[], float],
        most: int = MOST_CLIENTS,
    ) -> None:
        self._connections = connections
        self._bytes_per_second = bytes_per_second
        self._writes_per_minute = writes_per_minute
        self._unlimited = tuple(unlimited)
        self._clock = clock
        self._most = most
        self._clients: dict[str, Client] = {}
        self._newcomers = 0

    def __len__(self) -> int:
        return len(self._clients)

    def client(self, address: str) -> Client | None:
        """What is known of the client at `address`, or None if nothing is limited for it."""
        key = _key(address, self._unlimited)
        if key is None:
            return None
        known = self._clients.get(key)
        return known or self._newcomer(key)

    def enter(self, client: Client) -> bool:
        """Count one more connection, or return False if it is one too many."""
        if self._connections and client.connections >= self._connections:
            return False
        client.connections += 1
        return True

    def leave(self, client: Client) -> None:
        """Count one connection less."""
        client.connections -= 1
        if client.idle:
            self._clients.pop(client.key, None)

    def write(self, client: Client) -> int:
        """0 if the client may write now, else the whole seconds that it has to wait."""
        return 0 if client.writing is None else math.ceil(client.writing.try_take(1.0))

    def send(self, client: Client, size: int) -> float:
        """Seconds to wait before `size` bytes are sent."""
        return 0.0 if client.sending is None else client.sending.take(size)

    def _newcomer(self, key: str) -> Client:
        self._newcomers += 1
        if len(self._clients) >= self._most or self._newcomers % _PURGE_EVERY == 0:
            for idle in [client.key for client in self._clients.values() if client.idle]:
                del self._clients[idle]
        if len(self._clients) >= self._most:
            key = SHARED
            if key in self._clients:
                return self._clients[key]
        client = Client(key)
        if self._bytes_per_second:
            client.sending = TokenBucket(self._bytes_per_second, self._bytes_per_second, self._clock)
        if self._writes_per_minute:
            client.writing = TokenBucket(self._writes_per_minute / 60, self._writes_per_minute, self._clock)
        self._clients[key] = client
        return client


@lru_cache(maxsize=4096)
def _key(address: str, unlimited: tuple[Network, ...]) -> str | None:
    """The entry of an address, or None if it is not limited; what is not an address is one of its own."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return SHARED
    if isinstance(parsed, ipaddress.IPv6Address) and parsed.ipv4_mapped is not None:
        parsed = parsed.ipv4_mapped
    if any(parsed.version == network.version and parsed in network for network in unlimited):
        return None
    if isinstance(parsed, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((parsed, _SUBSCRIBER_BITS), strict=False))
    return str(parsed)
