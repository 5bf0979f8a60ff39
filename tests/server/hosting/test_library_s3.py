"""A server whose streams lie in a real S3 server: what it asks for, what it keeps, and what happens when that dies."""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from typing import TYPE_CHECKING

import httpx
import pytest

from meshtide_codec.stream.messages import Credit, HeaderPart, PacketPart, decode_message, encode_message
from meshtide_server.catalogue import Catalogue
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.operations.metrics import REGISTRY
from meshtide_server.settings import Settings
from meshtide_server.store import open_store, stream_key
from s3_server import BUCKET, running_s3_server

from ..conftest import running
from ..http.test_websocket import ClientSession, close_code, collect, hello, join, refusal
from ..made_streams import make_stream

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ..conftest import LiveServer

MIB = 1 << 20
DATA = make_stream(1, (MIB, 500, 600_000, 700_000, 50, 3 * MIB))
HELD = 2 * MIB
"""More than the first block, less than all."""


@contextmanager
def hosting(tmp_path: Path, endpoint: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveServer]:
    """A server of the mesh "vase", of DATA, which lies in the S3 server."""
    for name, value in (("AWS_ENDPOINT_URL", endpoint), ("AWS_ACCESS_KEY_ID", "any"), ("AWS_SECRET_ACCESS_KEY", "any")):
        monkeypatch.setenv(name, value)
    settings = Settings.model_validate(
        {
            "store": f"s3://{BUCKET}",
            "database": f"sqlite:///{tmp_path}/catalogue.db",
            "rescan_seconds": 0,
            "store_cache_mib": 16,
        }
    )

    async def put() -> None:
        catalogue = await Catalogue.open(settings.database_url)
        try:
            await publish(open_store(settings.store_url), catalogue, DATA, Publication("vase", "vase.ply"))
        finally:
            await catalogue.close()

    asyncio.run(put())
    monkeypatch.setattr("meshtide_server.store.s3.RETRY_SECONDS", 2)
    with running(settings) as server:
        yield server


def test_a_bucket_that_is_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("obstore", reason="the extra s3 is not installed")
    (tmp_path / "s3").mkdir()
    with running_s3_server(tmp_path / "s3") as endpoint, hosting(tmp_path, endpoint, monkeypatch) as server:
        assert httpx.get(f"{server.url}/readyz").json()["parts"]["store"] == "ok"
        told = {"store": "s3://elsewhere", "database": f"sqlite:///{tmp_path}/catalogue.db", "rescan_seconds": 0}
        with running(Settings.model_validate(told)) as other:
            answer = httpx.get(f"{other.url}/readyz")
            assert (answer.status_code, answer.json()["parts"]["store"]) == (503, "there is no such bucket")


def read_bytes() -> float:
    return REGISTRY.get_sample_value("meshtide_store_read_bytes_total") or 0.0


def test_streams_come_from_s3_by_ranges_and_survive_its_end_as_far_as_they_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("obstore", reason="the extra s3 is not installed")
    (tmp_path / "s3").mkdir()
    s3 = running_s3_server(tmp_path / "s3")
    with hosting(tmp_path, s3.__enter__(), monkeypatch) as server:
        try:
            url = f"{server.url}/meshes/vase.tide"
            before = read_bytes()
            part = httpx.get(url, headers={"Range": "bytes=2000-2999"})
            assert (part.status_code, part.content) == (206, DATA[2000:3000])
            assert read_bytes() - before == MIB  # the packet that holds them
            with join(server, "vase") as connection:
                assert collect(connection, ClientSession("vase"))[0] == DATA
            for _ in range(3):
                assert httpx.get(url).content == DATA
            assert read_bytes() - before <= len(DATA)
            server.loop.call_soon_threadsafe(forget_the_end, server)
            with join(server, "vase") as connection:
                connection.send(hello("vase", credit=HELD))
                received = 0
                while received < HELD:
                    message = decode_message(connection.recv(10))
                    assert isinstance(message, HeaderPart | PacketPart)
                    received += len(message.data)
                s3.__exit__(None, None, None)
                connection.send(encode_message(Credit(len(DATA))))
                error, closed = refusal(connection)
            assert (error.code, close_code(closed)) == ("not-ready", 1013)
            assert error.message == "the server's store does not answer as it should; try again in a moment"
            kept = httpx.get(url, headers={"Range": "bytes=2000-2999"})
            assert (kept.status_code, kept.content) == (206, DATA[2000:3000])
            gone = httpx.get(url, headers={"Range": "bytes=-100"})
            assert (gone.status_code, gone.json()["error"]) == (503, "not-ready")
            assert httpx.head(url).headers["content-length"] == str(len(DATA))
            with pytest.raises(httpx.RemoteProtocolError):
                httpx.get(url)  # begins with what is in memory, and is cut off rather than ended
        finally:
            s3.__exit__(None, None, None)


def forget_the_end(server: LiveServer) -> None:
    """Drop the block of the last packet."""
    kept = server.app.parts.library.published
    cache = kept.cache
    storage = kept.known("vase").stream.reader
    assert storage.key == stream_key(kept.known("vase").record.stream)
    cache._drop((storage.key, len(storage.starts) - 2))
