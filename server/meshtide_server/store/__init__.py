"""Where bytes are kept: one small protocol, and stores that keep it: a folder, memory, S3.

A store knows keys and bytes, not what they mean: meshes and streams are the other rooms' business. It imports none of
them.

>>> from meshtide_server.store import open_store
>>> open_store("memory:")
MemoryStore(0 objects)
"""

from __future__ import annotations

from meshtide_server.store.errors import (
    DamagedObjectError,
    InvalidKeyError,
    MissingBucketError,
    MissingObjectError,
    ObjectRangeError,
    StoreError,
)
from meshtide_server.store.keys import check_key, source_key, stream_key
from meshtide_server.store.opening import open_store
from meshtide_server.store.protocol import ObjectInfo, Store

__all__ = [
    "DamagedObjectError",
    "InvalidKeyError",
    "MissingBucketError",
    "MissingObjectError",
    "ObjectInfo",
    "ObjectRangeError",
    "Store",
    "StoreError",
    "check_key",
    "open_store",
    "source_key",
    "stream_key",
]
