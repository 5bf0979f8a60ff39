"""Versions of the catalogue's schema, each one made from the one before; run at every start, under a lock.

A step is plain SQL that SQLite and PostgreSQL both know; it is never changed once it was released. Steps run in one
transaction each time a server starts: either the schema is at the newest version afterwards, or as it was. Several
servers that start at the same time wait for each other. A database that a newer program has made is refused.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from sqlalchemy import insert, text

from meshtide_server.catalogue.errors import NewerSchemaError
from meshtide_server.catalogue.tables import schema_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sqlalchemy.ext.asyncio import AsyncConnection

logger = logging.getLogger("meshtide.server")

ADVISORY_LOCK = 0x6D657368_74696465
"""A number of our own that PostgreSQL locks while the schema is changed: "meshtide" in ASCII."""

STEPS: tuple[tuple[str, ...], ...] = (
    (
        """CREATE TABLE stream (
            sha256 TEXT PRIMARY KEY,
            fingerprint TEXT NOT NULL,
            header {bytes} NOT NULL,
            size BIGINT NOT NULL
        )""",
        """CREATE TABLE packet (
            stream_sha256 TEXT NOT NULL REFERENCES stream (sha256) ON DELETE CASCADE,
            position INTEGER NOT NULL,
            sha256 TEXT NOT NULL,
            start BIGINT NOT NULL,
            length BIGINT NOT NULL,
            PRIMARY KEY (stream_sha256, position)
        )""",
        "CREATE INDEX packet_by_sha256 ON packet (sha256)",
        """CREATE TABLE mesh (
            id TEXT {bytewise} PRIMARY KEY,
            name TEXT NOT NULL,
            licence TEXT NOT NULL,
            state TEXT NOT NULL,
            reason TEXT,
            stream_sha256 TEXT REFERENCES stream (sha256),
            source_sha256 TEXT,
            size BIGINT,
            vertices BIGINT,
            faces BIGINT,
            levels INTEGER,
            minimum_x DOUBLE PRECISION,
            minimum_y DOUBLE PRECISION,
            minimum_z DOUBLE PRECISION,
            maximum_x DOUBLE PRECISION,
            maximum_y DOUBLE PRECISION,
            maximum_z DOUBLE PRECISION,
            search_text TEXT NOT NULL,
            created BIGINT NOT NULL,
            updated BIGINT NOT NULL
        )""",
        "CREATE INDEX mesh_by_stream ON mesh (stream_sha256)",
        "CREATE INDEX mesh_by_source ON mesh (source_sha256)",
        "CREATE INDEX mesh_by_updated ON mesh (updated)",
        """CREATE TABLE mesh_tag (
            mesh_id TEXT NOT NULL REFERENCES mesh (id) ON DELETE CASCADE,
            tag TEXT NOT NULL,
            PRIMARY KEY (mesh_id, tag)
        )""",
        "CREATE INDEX mesh_tag_by_tag ON mesh_tag (tag)",
        """CREATE TABLE job (
            id TEXT PRIMARY KEY,
            mesh_id TEXT NOT NULL REFERENCES mesh (id) ON DELETE CASCADE,
            source_key TEXT NOT NULL,
            options TEXT NOT NULL,
            state TEXT NOT NULL,
            attempts INTEGER NOT NULL,
            owner TEXT,
            heartbeat BIGINT,
            stage TEXT NOT NULL,
            progress DOUBLE PRECISION NOT NULL,
            error TEXT,
            created BIGINT NOT NULL,
            finished BIGINT
        )""",
        "CREATE INDEX job_by_state ON job (state, created)",
        "CREATE INDEX job_by_mesh ON job (mesh_id)",
        "CREATE TABLE unused_stream (sha256 TEXT PRIMARY KEY, since BIGINT NOT NULL)",
    ),
    (  # what is counted every few seconds, and what a catalogue of many meshes is searched by
        "CREATE INDEX mesh_by_state ON mesh (state, id)",
        "CREATE INDEX mesh_by_created ON mesh (created)",
        "CREATE INDEX mesh_by_vertices ON mesh (vertices)",
    ),
    (
        "CREATE TABLE pending_upload (id TEXT PRIMARY KEY, source_key TEXT NOT NULL, since BIGINT NOT NULL)",
        "CREATE INDEX pending_upload_by_source ON pending_upload (source_key)",
        "CREATE INDEX job_by_source ON job (source_key)",
    ),
    (  # a mesh that is replaced stays as it is until the job is done; what of a file is not kept is noted
        "ALTER TABLE job ADD COLUMN description TEXT",
        "ALTER TABLE job ADD COLUMN notes TEXT",
    ),
)


async def migrate(connection: AsyncConnection, steps: Sequence[Sequence[str]] = STEPS) -> None:
    """Bring the schema to the newest version.

    Args:
        connection: in a transaction that writes; it is not committed here.
        steps: the statements that lead from each version to the next, version 0 being an empty database.

    Raises:
        NewerSchemaError: it is newer than `steps` know.
    """
    postgresql = connection.dialect.name == "postgresql"
    if postgresql:
        await connection.execute(text(f"SELECT pg_advisory_xact_lock({ADVISORY_LOCK})"))
    await connection.execute(text("CREATE TABLE IF NOT EXISTS schema_version (version INTEGER PRIMARY KEY)"))
    found = (await connection.execute(text("SELECT max(version) FROM schema_version"))).scalar() or 0
    if found > len(steps):
        raise NewerSchemaError(
            f"the catalogue has schema version {found}, this program knows versions up to {len(steps)}; "
            "install a newer meshtide, or name another database"
        )
    words = {"bytes": "BYTEA" if postgresql else "BLOB", "bytewise": 'COLLATE "C"' if postgresql else ""}
    for version, statements in enumerate(steps[found:], start=found + 1):
        for statement in statements:
            await connection.execute(text(statement.format(**words)))
        await connection.execute(insert(schema_table).values(version=version))
        logger.info("the catalogue's schema is at version %d", version)
