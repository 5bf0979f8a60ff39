"""Catalogues for the tests: each test that takes `database_url` runs on SQLite and on PostgreSQL."""

from __future__ import annotations

import hashlib
import secrets
from typing import TYPE_CHECKING

import asyncpg
import pytest

from meshtide_codec.stream.container import ContainerReader, fingerprint
from meshtide_server.catalogue import StreamRecord
from postgresql_server import running_postgresql

from .conftest import make_stream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator
    from pathlib import Path


@pytest.fixture(scope="session")
def postgresql() -> Iterator[str]:
    """The URL of a PostgreSQL server's first database."""
    with running_postgresql() as url:
        yield url


@pytest.fixture(params=["sqlite", "postgresql"])
async def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[str]:
    """The URL of a database of the test's own, empty."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path}/catalogue.db"
        return
    server: str = request.getfixturevalue("postgresql")
    name = f"test_{secrets.token_hex(8)}"
    connection = await asyncpg.connect(server)
    try:
        await connection.execute(f"CREATE DATABASE {name}")
        yield server.rsplit("/", 1)[0] + f"/{name}"
        await connection.execute(f"DROP DATABASE {name} WITH (FORCE)")
    finally:
        await connection.close()


def stream_record(seed: int = 0) -> StreamRecord:
    """What the catalogue keeps of the stream make_stream(seed)."""
    data = make_stream(seed)
    reader = ContainerReader()
    packets = reader.feed(data)
    return StreamRecord(
        sha256=hashlib.sha256(data).hexdigest(),
        fingerprint=fingerprint(reader.header_bytes).hex(),
        header=reader.header_bytes,
        size=len(data),
        packets=tuple(hashlib.sha256(packet.payload).digest() for packet in packets),
    )
