from __future__ import annotations

from typing import TYPE_CHECKING

import httpx
import pytest

from meshtide_client.ingest import _answer, ingest
from meshtide_codec.errors import PeerError, ProtocolError, TransferError

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("answer", [b"", b"[]", b"{}", b'{"id": "../x", "state": "done"}', b'{"id": "a", "state": 3}'])
def test_answers_that_describe_no_job_are_refused(answer: bytes) -> None:
    request = httpx.Request("POST", "http://localhost/meshes")
    with pytest.raises(ProtocolError, match="does not describe a job"):
        _answer(httpx.Response(202, content=answer, request=request))
    with pytest.raises(ProtocolError, match="HTTP status 500"):
        _answer(httpx.Response(500, content=answer, request=request))


def test_a_refusal_is_told_in_the_servers_words() -> None:
    body = b'{"error": "read-only", "message": "this server takes no uploads"}'
    request = httpx.Request("POST", "http://localhost/meshes")
    with pytest.raises(PeerError, match="takes no uploads"):
        _answer(httpx.Response(403, content=body, request=request))


def test_a_server_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(TransferError, match="cannot reach"):
        ingest([tmp_path / "a.ply"], "http://127.0.0.1:9")
