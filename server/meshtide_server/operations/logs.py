"""The log: one line an event, as text for people or as JSON for programs, each with the id of its request.

The id of the request that is being answered is bound to the running task, so that every line that is written on its
behalf carries it, also those of libraries. Nothing secret gets into a line: queries of addresses are not logged, and
what looks like a credential is struck out (see redaction.py). What others have said, such as ids, headers and names of
files, is shown escaped: no entry has a second line but the trace of a fault, which is indented.
"""

from __future__ import annotations

import json
import logging
import re
import secrets
import sys
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from meshtide_codec.printable import printable
from meshtide_server.operations.redaction import RedactionFilter, redact

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_server.settings import LogFormat

HEADER = b"x-request-id"
"""The header that brings an id in and returns it, in the spelling of ASGI."""

LONGEST_LINE = 10_000
"""Characters of a line; an error may quote all of a file."""
_VALID = re.compile(rb"[A-Za-z0-9][A-Za-z0-9._:-]{0,127}", re.ASCII)
_ID_BYTES = 8
_request_id: ContextVar[str | None] = ContextVar("request_id", default=None)
_LIBRARIES = ("uvicorn", "uvicorn.error", "websockets", "asyncio")
"""Their loggers write every frame and every header at level debug, which hides what this program says."""


def request_id() -> str | None:
    """The id of the request that the running task answers, or None outside of one."""
    return _request_id.get()


def accepted_id(value: bytes | None) -> str:
    r"""`value` if a client may choose it, else a new id.

    >>> accepted_id(b"checkout-17")
    'checkout-17'
    >>> len(accepted_id(b"two\nlines"))
    16
    """
    if value is not None and _VALID.fullmatch(value):
        return value.decode("ascii")
    return secrets.token_hex(_ID_BYTES)


@contextmanager
def bound_id(identifier: str) -> Iterator[None]:
    """Within the block, and in tasks begun in it, lines carry `identifier`."""
    token = _request_id.set(identifier)
    try:
        yield
    finally:
        _request_id.reset(token)


def indented(trace: str) -> str:
    """A traceback as it may follow a line: no line of it looks like an entry, whatever an error quotes."""
    return "\n".join(f"    {printable(line, LONGEST_LINE)}" for line in trace.split("\n"))


class TextFormatter(logging.Formatter):
    """Time, level, message; then the request's id, if there is one."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(message)s", datefmt="%H:%M:%S")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """The line, without the traceback that may follow it."""
        line = printable(super().formatMessage(record), LONGEST_LINE)
        identifier = request_id()
        return line if identifier is None else f"{line} (request {identifier})"

    def format(self, record: logging.LogRecord) -> str:
        """The line, and the traceback that may follow it."""
        if record.exc_info and not record.exc_text:
            record.exc_text = self.formatException(record.exc_info)
        traced, record.exc_text = record.exc_text, indented(record.exc_text) if record.exc_text else None
        try:
            return super().format(record)
        finally:
            record.exc_text = traced


class JsonFormatter(logging.Formatter):
    """One JSON object a line.

    It has `time` (UTC), `level`, `logger` and `message`; `request_id` within a request; `exception` where there was
    one; and whatever the caller gave as `extra={"fields": {...}}`.
    """

    def format(self, record: logging.LogRecord) -> str:
        """The whole entry."""
        entry: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        identifier = request_id()
        if identifier is not None:
            entry["request_id"] = identifier
        for name, value in getattr(record, "fields", {}).items():
            entry[name] = redact(value) if isinstance(value, str) else value
        if record.exc_info:
            entry["exception"] = record.exc_text or self.formatException(record.exc_info)
        return json.dumps(entry, default=str)


class PeerFilter(logging.Filter):
    """Makes a line of what uvicorn logs as an error with a traceback and is a client's doing: text that is no UTF-8."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Let the record pass, as what it is."""
        if record.exc_info and isinstance(record.exc_info[1], UnicodeDecodeError):
            record.levelno, record.levelname = logging.INFO, logging.getLevelName(logging.INFO)
            record.msg, record.args = "a client broke the protocol: a text frame that is no UTF-8", ()
            record.exc_info = record.exc_text = None
        return True


def set_up_log(level: str, form: LogFormat = "text") -> None:
    """Send the log to standard error.

    Args:
        level: debug, info, warning or error.
        form: text, or json.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(RedactionFilter())
    handler.setFormatter(JsonFormatter() if form == "json" else TextFormatter())
    root = logging.getLogger()
    for old in list(root.handlers):
        root.removeHandler(old)
    root.addHandler(handler)
    root.setLevel(level.upper())
    for name in _LIBRARIES:
        logging.getLogger(name).setLevel(logging.INFO if level == "debug" else logging.WARNING)
    peers = logging.getLogger("uvicorn.error")
    for old_filter in [each for each in peers.filters if isinstance(each, PeerFilter)]:
        peers.removeFilter(old_filter)
    peers.addFilter(PeerFilter())
