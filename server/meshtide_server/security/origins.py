"""Which web pages may read the meshes.

Browsers let a page of any origin open websockets to any server, also to one that only this machine can reach, so the
server has to look at the origin itself. Programs that are not browsers send none and are always let in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


def may_connect(headers: Mapping[str, str], allowed: Sequence[str]) -> bool:
    """Whether a websocket handshake with these headers (lower-case names) may go on.

    >>> may_connect({"host": "localhost:8000"}, ())
    True
    >>> may_connect({"host": "localhost:8000", "origin": "http://localhost:8000"}, ())
    True
    >>> may_connect({"host": "localhost:8000", "origin": "https://elsewhere.example"}, ())
    False
    """
    origin = headers.get("origin")
    if origin is None or "*" in allowed or origin in allowed:
        return True
    try:
        return urlsplit(origin).netloc.lower() == headers.get("host", "").lower() != ""
    except ValueError:
        return False
