"""What a meshtide server says over HTTP when it refuses."""

from __future__ import annotations

import json

from meshtide_codec.errors import PeerError

LARGEST_PROBLEM = 1 << 16
_LONGEST_TEXT = 1000


def read_problem(body: bytes) -> PeerError | None:
    """The refusal in the body of an answer, or None if it is not a meshtide server's.

    >>> read_problem(b'{"error": "unknown-mesh", "message": "there is no mesh"}')
    PeerError('there is no mesh (unknown-mesh)')
    """
    if len(body) > LARGEST_PROBLEM:
        return None
    try:
        value = json.loads(body)
        return PeerError(str(value["error"])[:_LONGEST_TEXT], str(value["message"])[:_LONGEST_TEXT])
    except (ValueError, RecursionError, LookupError, TypeError):
        return None
