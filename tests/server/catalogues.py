"""What the tests put into catalogues."""

from __future__ import annotations

import hashlib

from meshtide_codec.stream.container import ContainerReader, fingerprint
from meshtide_server.catalogue import StreamRecord

from .made_streams import make_stream


def stream_record(seed: int = 0) -> StreamRecord:
    """What the catalogue keeps of the stream make_stream(seed)."""
    data = make_stream(seed)
    reader = ContainerReader()
    packets = reader.feed(data)
    return StreamRecord(
        sha256=hashlib.sha256(data).hexdigest(),
        fingerprint=fingerprint(reader.header_bytes).hex(),
        header=reader.header_bytes,
        size=len(data),
        packets=tuple(hashlib.sha256(packet.payload).digest() for packet in packets),
    )
