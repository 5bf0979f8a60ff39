import asyncio
from pathlib import Path

import pytest
from sqlalchemy import inspect

from meshtide_codec.errors import OptionError
from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Catalogue, DatabaseUnavailableError, MeshRecord, NewerSchemaError
from meshtide_server.catalogue.database import Database, checked_url
from meshtide_server.catalogue.migrations import STEPS, migrate
from meshtide_server.catalogue.tables import metadata


async def test_the_migrations_make_the_tables_that_the_code_knows(database_url: str) -> None:
    database = Database(database_url)
    async with database.writing() as connection:
        await migrate(connection)

        def columns(sync: object) -> dict[str, dict[str, bool]]:
            inspector = inspect(sync)
            return {
                table: {
                    column["name"]: column["nullable"] and column["name"] not in keys(inspector, table)
                    for column in inspector.get_columns(table)
                }
                for table in inspector.get_table_names()
            }

        def keys(inspector: object, table: str) -> list[str]:
            return list(inspector.get_pk_constraint(table)["constrained_columns"])  # type: ignore[attr-defined]

        found = await connection.run_sync(columns)
    await database.close()
    assert found == {
        table.name: {column.name: bool(column.nullable) for column in table.columns}
        for table in metadata.tables.values()
    }


async def test_servers_that_start_together_migrate_once(database_url: str) -> None:
    catalogues = await asyncio.gather(*(Catalogue.open(database_url) for _ in range(6)))
    await catalogues[0].meshes.add(MeshRecord("a", "a.obj"))
    assert [len((await each.meshes.list(MeshQuery())).meshes) for each in catalogues] == [1] * 6
    for each in catalogues:
        await each.close()


async def test_many_servers_make_a_new_sqlite_file_at_once(tmp_path: Path) -> None:
    """Each switches it to a write-ahead log, which SQLite refuses while another one does."""
    for turn in range(12):
        address = f"sqlite:///{tmp_path}/{turn}.db"
        for catalogue in await asyncio.gather(*(Catalogue.open(address) for _ in range(8))):
            await catalogue.close()
        database = Database(address)
        async with database.reading() as connection:
            mode = (await connection.exec_driver_sql("PRAGMA journal_mode")).scalar()
        await database.close()
        assert mode == "wal"


async def test_a_newer_schema_is_refused(database_url: str) -> None:
    database = Database(database_url)
    newer = (*STEPS, ("CREATE TABLE later (id INTEGER)",))
    async with database.writing() as connection:
        await migrate(connection, newer)
    await database.close()
    with pytest.raises(NewerSchemaError, match=f"has schema version {len(newer)}, this program knows .* {len(STEPS)};"):
        await Catalogue.open(database_url)


async def test_a_step_that_fails_leaves_the_schema_as_it_was(database_url: str) -> None:
    catalogue = await Catalogue.open(database_url)
    await catalogue.close()
    database = Database(database_url)
    broken = (*STEPS, ("CREATE TABLE later (id INTEGER)", "CREATE TABLE mesh (id INTEGER)"))
    with pytest.raises(DatabaseUnavailableError, match="already exists"):
        async with database.writing() as connection:
            await migrate(connection, broken)
    async with database.writing() as connection:
        await migrate(connection, (*STEPS, ("CREATE TABLE later (id INTEGER)",)))
    await database.close()


async def test_a_database_that_is_not_there_is_told_without_its_password() -> None:
    with pytest.raises(DatabaseUnavailableError, match="the database postgresql") as caught:
        await Catalogue.open("postgresql://me:secret@127.0.0.1:1/meshes")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("url", ["", "meshes.db", "mysql://h/d", "postgresql://h", "sqlite://", "sqlite:///:memory:"])
def test_foreign_addresses_are_refused(url: str) -> None:
    with pytest.raises(OptionError, match="database"):
        checked_url(url)
