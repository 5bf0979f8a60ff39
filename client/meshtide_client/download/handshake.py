"""What it means that a websocket could not be opened: every failure as an error of the tree, in words for people."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from websockets.exceptions import InvalidHandshake, InvalidMessage, InvalidStatus, InvalidURI, SecurityError

from meshtide_client.connection.content_coding import read_body
from meshtide_client.connection.problem import LARGEST_PROBLEM, read_problem
from meshtide_client.connection.secrecy import without_secrets
from meshtide_client.connection.tls import distrust
from meshtide_codec.errors import PeerError, ProtocolError, TransferError

if TYPE_CHECKING:
    from websockets.http11 import Response

    from meshtide_client.connection.address import MeshAddress

_BUSY_STATUSES = frozenset({429, 500, 502, 503, 504})
_ERROR_NUMBER = re.compile(r"\[Errno (\d+)\]")


def handshake_problem(error: Exception, address: MeshAddress, timeout: float) -> TransferError | ProtocolError:
    """What `error`, which came when a stream was to be opened, means for the caller.

    Args:
        error: what the websocket library or the system raised.
        address: whose stream it was.
        timeout: seconds that were waited for.
    """
    server, place = address.server, without_secrets(address.stream_url)
    if isinstance(error, InvalidStatus):
        return _no_stream(error.response, str(server), place)
    if isinstance(error, InvalidMessage):
        return _no_answer(error, str(server))
    if isinstance(error, SecurityError):
        return ProtocolError(f"{place} is redirected to an address without TLS; that is not followed")
    if isinstance(error, InvalidHandshake):
        return ProtocolError(f"{place} does not answer as a websocket: {without_secrets(str(error))}")
    if isinstance(error, TimeoutError):
        return TransferError(f"{server} did not answer within {timeout:g} seconds")
    if isinstance(error, InvalidURI) or (isinstance(error, ValueError) and not isinstance(error, OSError)):
        return ProtocolError(f"{place} is redirected to what is not an address of a stream")
    return TransferError(f"cannot connect to {server}: {distrust(error) or without_secrets(_reason(error))}")


def _no_stream(response: Response, server: str, place: str) -> TransferError | ProtocolError:
    """An answer of HTTP where a websocket was asked for."""
    status = response.status_code
    coding = response.headers.get("Content-Encoding", "")
    try:
        problem: PeerError | None = read_problem(
            read_body([bytes(response.body or b"")], coding, place, LARGEST_PROBLEM)
        )
    except (ProtocolError, TransferError):
        problem = None
    if problem is not None:
        return problem
    if status in _BUSY_STATUSES:
        return TransferError(f"{server} is not available now (HTTP status {status})")
    return ProtocolError(f"{place} answered with HTTP status {status} instead of a stream; check the address")


def _no_answer(error: InvalidMessage, server: str) -> TransferError | ProtocolError:
    if isinstance(error.__cause__, EOFError):
        return TransferError(f"{server} closed the connection before it was open")
    what = "speaks no websockets" if "HTTP/1.0" in str(error.__cause__) else "is not a web server; check the address"
    return ProtocolError(f"what answers at {server} {what}")


def _reason(error: Exception) -> str:
    """Why a connection could not be opened, in the system's words without its numbers and brackets.

    >>> _reason(ConnectionRefusedError(111, "Connect call failed ('127.0.0.1', 9)")) == os.strerror(111)
    True
    """
    text = str(error)
    number = _ERROR_NUMBER.search(text)  # several addresses of one host come back as one text
    return os.strerror(int(number[1])) if number and "Connect call failed" in text else text or type(error).__name__
