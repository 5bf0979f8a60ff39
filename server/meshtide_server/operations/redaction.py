"""Keeps secrets out of the log: what looks like a token, a ticket or a password is struck out of every record.

This server logs none of them by itself. The libraries below it do at level debug, where websockets prints the headers
of each handshake and uvicorn prints addresses with their queries.
"""

from __future__ import annotations

import logging
import re

STRUCK = "[struck out]"
_SECRETS = re.compile(
    r"""((?:authorization|cookie)["']?\s*[:=,]\s*(?:b?["'])?)[^"'\r\n]+  # a header
    |(\bbearer\s+)[^\s"',;]+                                       # its value by itself
    |([?&]ticket=)[^&\s"']+                                        # in an address
    |(://[^/\s:@]*:)[^/\s@]+(?=@)                                  # a password in an address
    """,
    re.IGNORECASE | re.VERBOSE,
)


def redact(text: str) -> str:
    """`text` without secrets.

    >>> redact("GET /meshes/vase/stream?ticket=abc HTTP/1.1, Authorization: Bearer def")
    'GET /meshes/vase/stream?ticket=[struck out] HTTP/1.1, Authorization: [struck out]'
    """
    return _SECRETS.sub(lambda match: next(group for group in match.groups() if group is not None) + STRUCK, text)


class RedactionFilter(logging.Filter):
    """Put on a handler, it strikes secrets out of what passes; tracebacks included."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Never holds a record back."""
        try:
            message = record.getMessage()
        except (TypeError, ValueError):
            return True  # a record that cannot be written; the handler says where it came from
        redacted = redact(message)
        if redacted != message:
            record.msg, record.args = redacted, ()
        if record.exc_info and not record.exc_text:
            record.exc_text = redact(logging.Formatter().formatException(record.exc_info))
        return True
