from __future__ import annotations

import gzip
import ssl
from http import HTTPStatus

import pytest
from websockets.datastructures import Headers
from websockets.exceptions import (
    InvalidMessage,
    InvalidProxy,
    InvalidStatus,
    InvalidUpgrade,
    InvalidURI,
    SecurityError,
)
from websockets.http11 import Response

from meshtide_client.connection.address import MeshAddress
from meshtide_client.download.handshake import handshake_problem
from meshtide_codec.errors import PeerError, ProtocolError, TransferError

ADDRESS = MeshAddress.parse("https://me:secret@example.org/meshes/vase")
PROBLEM = b'{"error": "unknown-mesh", "message": "there is no \\u001b[2Jvase"}'


def status(code: int, body: bytes = b"", **headers: str) -> InvalidStatus:
    named = Headers({name.replace("_", "-"): value for name, value in headers.items()})
    return InvalidStatus(Response(code, HTTPStatus(code).phrase, named, body))


@pytest.mark.parametrize(
    ("error", "kind", "message"),
    [
        (status(404), ProtocolError, "answered with HTTP status 404 instead of a stream"),
        (status(503), TransferError, "is not available now"),
        (status(404, PROBLEM), PeerError, r"there is no \x1b[2Jvase (unknown-mesh)"),
        (status(404, gzip.compress(PROBLEM), Content_Encoding="gzip"), PeerError, "(unknown-mesh)"),
        (status(404, gzip.compress(bytes(1 << 24)), Content_Encoding="gzip"), ProtocolError, "HTTP status 404"),
        (status(404, b"abc", Content_Encoding="gzip"), ProtocolError, "HTTP status 404"),
        (InvalidMessage("nothing"), ProtocolError, "is not a web server"),
        (InvalidUpgrade("Upgrade", "\x1b[2J"), ProtocolError, "does not answer as a websocket"),
        (SecurityError("downgrade to http://me:secret@h"), ProtocolError, "without TLS"),
        (InvalidURI("http://me:secret@h", "scheme"), ProtocolError, "not an address of a stream"),
        (ValueError("Invalid IPv6 URL"), ProtocolError, "not an address of a stream"),
        (TimeoutError(), TransferError, "did not answer within 7 seconds"),
        (OSError(5, "broken"), TransferError, "broken"),
        (ssl.SSLCertVerificationError(1, "verify failed"), TransferError, "its certificate is not trusted"),
        (InvalidProxy("http://me:secret@proxy", "no"), TransferError, "cannot connect to https://example.org"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else None,
)
def test_every_failure_is_told_without_secrets(error: Exception, kind: type[Exception], message: str) -> None:
    problem = handshake_problem(error, ADDRESS, 7.0)
    assert type(problem) is kind
    assert message in str(problem)
    assert "secret" not in str(problem)
    assert str(problem).isprintable()
