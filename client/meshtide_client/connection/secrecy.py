"""Addresses without what may be secret in them: passwords, and the queries of signed URLs."""

from __future__ import annotations

import re
from urllib.parse import urlsplit, urlunsplit

HIDDEN = "..."
_USER = re.compile(r"(?<=://)[^/?#\s'\"]*@")
_QUERY = re.compile(r"(?<=[?#])[^\s'\"<>]+")


def without_secrets(text: str) -> str:
    """A sentence in which every address has lost user, password, query and fragment.

    >>> without_secrets("cannot follow https://me:pw@example.org/a.tide?X-Amz-Signature=12ab")
    'cannot follow https://example.org/a.tide?...'
    """
    return _QUERY.sub(HIDDEN, _USER.sub("", text))


def shown_address(url: str) -> str:
    """An address, or what somebody took for one, as it may be shown.

    >>> shown_address(" https://me:pw@example.org/vase.tide?key=1#top ")
    'https://example.org/vase.tide?...'
    """
    try:
        parts = urlsplit(url.strip())
    except ValueError:
        return without_secrets(url.strip())
    query = HIDDEN if parts.query or parts.fragment else ""
    return urlunsplit((parts.scheme, parts.netloc.rpartition("@")[2], parts.path, query, ""))
