"""Packets by the digest of their bytes: where the streams that are hosted hold them.

A packet is stored once, inside of its stream; its address is the SHA-256 of its bytes, so it never changes and may be
kept by every cache for ever. A packet that several streams hold is found as long as one of them is hosted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from meshtide_server.hosting.stream import HostedStream


class PacketPlace(NamedTuple):
    """Where a packet lies."""

    stream: HostedStream
    position: int


class PacketIndex:
    """The packets of all hosted streams."""

    def __init__(self) -> None:
        self._streams: dict[str, HostedStream] = {}
        self._places: dict[bytes, dict[str, int]] = {}

    def add(self, mesh_id: str, stream: HostedStream) -> None:
        """Note the packets of the mesh's stream; they replace those of an earlier one."""
        self.remove(mesh_id)
        self._streams[mesh_id] = stream
        for index, digest in enumerate(stream.packet_digests):
            self._places.setdefault(digest, {})[mesh_id] = index

    def remove(self, mesh_id: str) -> None:
        """Forget the packets of a mesh, if there are any."""
        stream = self._streams.pop(mesh_id, None)
        for digest in stream.packet_digests if stream else ():
            holders = self._places.get(digest, {})
            holders.pop(mesh_id, None)
            if not holders:
                self._places.pop(digest, None)

    def find(self, digest: bytes) -> PacketPlace | None:
        """A place of the packet whose bytes have that SHA-256; of several, one that is not known to be stale."""
        places = [PacketPlace(self._streams[mesh_id], index) for mesh_id, index in self._places.get(digest, {}).items()]
        return next((place for place in places if place.stream.reader.unchanged()), places[0] if places else None)
