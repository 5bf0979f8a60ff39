"""The database below a catalogue: from its address to an engine whose transactions do the same on both kinds.

SQLite: write-ahead log, foreign keys, every commit on the disk, patience with other processes; transactions that write
take the write lock at once, so that none fails in the middle. PostgreSQL: as it comes, through asyncpg (extra
`postgres`).
"""

from __future__ import annotations

import asyncio
import re
import sqlite3
import time
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import event, text
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.ext.asyncio import create_async_engine
from sqlalchemy.util import await_only

from meshtide_codec.errors import OptionError
from meshtide_codec.extras import missing_library
from meshtide_server.catalogue.errors import DatabaseUnavailableError
from meshtide_server.catalogue.migrations import ADVISORY_LOCK

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from sqlalchemy import Connection
    from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine

BUSY_MILLISECONDS = 30_000
_BUSY_PAUSE = 0.01  # seconds
"""How long one SQLite transaction waits for another one to end."""
POOL_SIZE = 5
POOL_OVERFLOW = 10
POOL_SECONDS = 30
"""How long a transaction waits for one of this process's connections."""
_POSTGRESQL = re.compile(r"postgres(ql)?(\+asyncpg)?")


class Database:
    """Transactions on one database.

    Args:
        url: see `checked_url`.

    Raises:
        OptionError: it is not an address of a database.
        MissingLibraryError: the library that it needs is not installed.
    """

    def __init__(self, url: str) -> None:
        address = checked_url(url)
        options: dict[str, Any] = {"pool_size": POOL_SIZE, "max_overflow": POOL_OVERFLOW, "pool_timeout": POOL_SECONDS}
        try:
            self._engine: AsyncEngine = create_async_engine(address, pool_pre_ping=True, **options)
        except ImportError as error:
            raise missing_library("asyncpg", "postgres", error, "PostgreSQL") from error
        self._readers = self._engine.execution_options(meshtide_reads=True)
        self.is_sqlite = self._engine.dialect.name == "sqlite"
        self._name = address.render_as_string(hide_password=True)
        if self.is_sqlite:
            event.listen(self._engine.sync_engine, "connect", _set_up_sqlite)
            event.listen(self._engine.sync_engine, "begin", _begin_sqlite)

    @asynccontextmanager
    async def writing(self) -> AsyncIterator[AsyncConnection]:
        """A transaction that may write; it is committed at the end of the block, or undone if that raises.

        Raises:
            DatabaseUnavailableError: the database cannot be reached, is busy for too long, or fails.
        """
        with self._told():
            async with self._engine.begin() as connection:
                yield connection

    @asynccontextmanager
    async def reading(self) -> AsyncIterator[AsyncConnection]:
        """A transaction that only reads, and waits for no writer."""
        with self._told():
            async with self._readers.begin() as connection:
                yield connection

    @asynccontextmanager
    async def locked(self) -> AsyncIterator[AsyncConnection]:
        """A transaction that may write, one at a time of all processes; SQLite's always are."""
        async with self.writing() as connection:
            if not self.is_sqlite:
                await connection.execute(text(f"SELECT pg_advisory_xact_lock({ADVISORY_LOCK})"))
            yield connection

    async def close(self) -> None:
        """Let go of all connections; may be called twice."""
        await self._engine.dispose()

    def _told(self) -> _Telling:
        return _Telling(self._name)

    def __repr__(self) -> str:
        return f"Database({self._name})"


class _Telling:
    """A context manager: the driver's errors become this package's own; constraints are the caller's to read."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, DBAPIError | PoolTimeoutError | OSError) or (
            isinstance(error, SQLAlchemyError) and not isinstance(error, ArgumentError)
        ):
            reason = str(getattr(error, "orig", None) or error).strip().split("\n", maxsplit=1)[0]
            raise DatabaseUnavailableError(f"the database {self._name}: {reason}") from error


def checked_url(url: str) -> URL:
    """The address of a database, with the driver that is used.

    Args:
        url: ``sqlite:///relative.db``, ``sqlite:////absolute.db``, or ``postgresql://user:password@host/name``.

    Raises:
        OptionError: it is none of these, or the folder of the SQLite file cannot be made.

    >>> checked_url("postgresql://me@db.example/meshes").drivername
    'postgresql+asyncpg'
    """
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        parsed = None
    if parsed is not None and parsed.drivername in {"sqlite", "sqlite+aiosqlite"} and parsed.database:
        if parsed.database == ":memory:":
            raise OptionError("a database in memory is seen by one connection only; name a file: sqlite:///meshes.db")
        try:
            Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OptionError(f"no database can be kept in {parsed.database}: {error.strerror or error}") from error
        return parsed.set(drivername="sqlite+aiosqlite")
    if parsed is not None and _POSTGRESQL.fullmatch(parsed.drivername) and parsed.database:
        return parsed.set(drivername="postgresql+asyncpg")
    shown = parsed.render_as_string(hide_password=True) if parsed is not None else "what was given"
    raise OptionError(f"{shown} is not a database: sqlite:///file.db or postgresql://user:password@host/name")


def _set_up_sqlite(connection: Any, _: object) -> None:  # noqa: ANN401 - the driver's own type
    connection.isolation_level = None  # the driver begins no transactions by itself; _begin_sqlite does
    connection.create_function("lower", 1, _lower, deterministic=True)
    cursor = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout = {BUSY_MILLISECONDS}")
    _write_ahead(cursor)
    cursor.execute("PRAGMA synchronous = FULL")
    cursor.execute("PRAGMA foreign_keys = ON")
    cursor.close()


def _write_ahead(cursor: Any) -> None:  # noqa: ANN401 - the driver's own type
    """Switch to a write-ahead log; where others do so too, SQLite is busy at once, whatever timeout it is given.

    It is called where SQLAlchemy waits for the driver, so it may wait too.
    """
    deadline = time.monotonic() + BUSY_MILLISECONDS / 1000.0
    while True:
        try:
            cursor.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                raise
            await_only(asyncio.sleep(_BUSY_PAUSE))
        else:
            return


def _lower(text: str | None) -> str | None:
    """SQLite's own knows the letters of ASCII only."""
    return None if text is None else text.lower()


def _begin_sqlite(connection: Connection) -> None:
    reads = connection.get_execution_options().get("meshtide_reads", False)
    connection.exec_driver_sql("BEGIN" if reads else "BEGIN IMMEDIATE")
