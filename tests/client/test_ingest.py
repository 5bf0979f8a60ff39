from __future__ import annotations

from typing import TYPE_CHECKING

import httpx
import pytest

from meshtide_client.ingest import _answer, ingest, mesh_files
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError

if TYPE_CHECKING:
    from pathlib import Path


def test_folders_are_searched_and_files_are_taken_as_they_are_named(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("b.obj", "a.ply", "deep/c.tide", "notes.txt", "d.gltf"):
        (tmp_path / name).write_bytes(b"x")
    found = [str(file.relative_to(tmp_path)) for file in mesh_files([tmp_path, tmp_path / "notes.txt"])]
    assert found == ["a.ply", "b.obj", "deep/c.tide", "notes.txt"]


def test_nothing_to_upload_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no meshes"):
        mesh_files([tmp_path])
    with pytest.raises(OptionError, match="there is no file or folder"):
        mesh_files([tmp_path / "gone"])


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
