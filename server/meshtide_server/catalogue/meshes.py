"""Meshes in the catalogue: adding, changing, finding and removing them."""

from __future__ import annotations

import operator
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import and_, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from meshtide_server.catalogue.errors import MeshExistsError, UnknownMeshError
from meshtide_server.catalogue.rows import Box, MeshPage, MeshRecord, Status, now
from meshtide_server.catalogue.tables import BOX_COLUMNS, mesh_table, tag_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sqlalchemy import ColumnElement, RowMapping
    from sqlalchemy.ext.asyncio import AsyncConnection

    from meshtide_codec.stream.mesh_query import MeshQuery
    from meshtide_server.catalogue.database import Database

LARGEST_PAGE = 1000
_AFTER_ALL = "{"
"""The character after all that an id may hold."""


class Meshes:
    """The meshes of a catalogue.

    Every method may raise `DatabaseUnavailableError`.

    Args:
        database: of them.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    async def add(self, mesh: MeshRecord) -> MeshRecord:
        """Add a mesh under a new id; returns what stands there now.

        Raises:
            MeshExistsError: there is a mesh of that id.
        """
        async with self._database.writing() as connection:
            return await add_mesh(connection, mesh)

    async def put(self, mesh: MeshRecord) -> MeshRecord:
        """Add a mesh, or replace the one of that id, which keeps the time of its creation.

        The stream that it had stays until `Catalogue.collect` finds that no mesh needs it.
        """
        async with self._database.writing() as connection:
            return await put_mesh(connection, mesh)

    async def get(self, mesh_id: str) -> MeshRecord:
        """The mesh of that id.

        Raises:
            UnknownMeshError: there is none.
        """
        async with self._database.reading() as connection:
            return await get_mesh(connection, mesh_id)

    async def updated(self, ids: Sequence[str]) -> dict[str, datetime]:
        """When each of these meshes was last changed; those that are gone are left out."""
        statement = select(mesh_table.c.id, mesh_table.c.updated).where(mesh_table.c.id.in_(ids))
        async with self._database.reading() as connection:
            return {mesh_id: moment(when) for mesh_id, when in (await connection.execute(statement)).all()}

    async def ids(self, prefix: str) -> list[str]:
        """The ids that begin with `prefix`, in their order."""
        column = mesh_table.c.id
        within = and_(column >= prefix, column < prefix + _AFTER_ALL)
        async with self._database.reading() as connection:
            return list((await connection.execute(select(column).where(within).order_by(column))).scalars())

    async def tags(self, limit: int) -> list[tuple[str, int]]:
        """Tags and how many meshes have each, those of most meshes first."""
        number = func.count().label("number")
        statement = select(tag_table.c.tag, number).group_by(tag_table.c.tag)
        async with self._database.reading() as connection:
            ordered = statement.order_by(number.desc(), tag_table.c.tag).limit(limit)
            return [(tag, count) for tag, count in (await connection.execute(ordered)).all()]

    async def find_source(self, sha256: str) -> MeshRecord | None:
        """A mesh that was made from the file with that SHA-256, one that is ready before all others."""
        async with self._database.reading() as connection:
            statement = select(mesh_table.c.id).where(mesh_table.c.source_sha256 == sha256)
            ready = mesh_table.c.state == Status.READY.value
            found = (await connection.execute(statement.order_by(ready.desc(), mesh_table.c.created))).scalars().first()
            return await get_mesh(connection, found) if found is not None else None

    async def fail(self, mesh_id: str, reason: str) -> None:
        """Note that a mesh cannot be served; nothing happens if it is gone."""
        async with self._database.writing() as connection:
            await fail_mesh(connection, mesh_id, reason)

    async def list(self, query: MeshQuery, limit: int = LARGEST_PAGE) -> MeshPage:
        """The meshes that were asked for, in the order of their ids, one page of them.

        Args:
            query: which ones; the `next` of the page before is the `after` of the following one.
            limit: how many at most.
        """
        limit = min(max(limit, 1), LARGEST_PAGE)
        statement = select(mesh_table).where(and_(True, *_conditions(query)))
        async with self._database.reading() as connection:
            rows = (await connection.execute(statement.order_by(mesh_table.c.id).limit(limit + 1))).mappings().all()
            meshes = await _records(connection, rows[:limit])
        return MeshPage(tuple(meshes), meshes[-1].id if len(rows) > limit else None)

    async def count(self) -> dict[Status, int]:
        """How many meshes are in which state."""
        statement = select(mesh_table.c.state, func.count())
        async with self._database.reading() as connection:
            rows = (await connection.execute(statement.group_by(mesh_table.c.state))).all()
        counts = dict.fromkeys(Status, 0)
        counts.update({Status(state): number for state, number in rows})
        return counts


async def add_mesh(connection: AsyncConnection, mesh: MeshRecord) -> MeshRecord:
    """Add a mesh within a transaction; see `Meshes.add`."""
    try:
        await connection.execute(insert(mesh_table).values(**_values(mesh), id=mesh.id, created=micros(mesh.created)))
    except IntegrityError as error:
        if "mesh_pkey" in str(error.orig) or "mesh.id" in str(error.orig):
            raise MeshExistsError(mesh.id) from error
        raise
    await _put_tags(connection, mesh)
    return await get_mesh(connection, mesh.id)


async def put_mesh(connection: AsyncConnection, mesh: MeshRecord) -> MeshRecord:
    """Add or replace a mesh within a transaction; see `Meshes.put`."""
    changed = replace(mesh, updated=now())
    statement = update(mesh_table).where(mesh_table.c.id == mesh.id).values(**_values(changed))
    if (await connection.execute(statement)).rowcount == 0:
        return await add_mesh(connection, mesh)
    await connection.execute(delete(tag_table).where(tag_table.c.mesh_id == mesh.id))
    await _put_tags(connection, mesh)
    return await get_mesh(connection, mesh.id)


async def get_mesh(connection: AsyncConnection, mesh_id: str) -> MeshRecord:
    """The mesh of that id, within a transaction; see `Meshes.get`."""
    rows = (await connection.execute(select(mesh_table).where(mesh_table.c.id == mesh_id))).mappings().all()
    if not rows:
        raise UnknownMeshError(mesh_id)
    return (await _records(connection, rows))[0]


async def fail_mesh(connection: AsyncConnection, mesh_id: str, reason: str) -> None:
    """Note that a mesh cannot be served, unless an earlier stream of it still can."""
    unfinished = and_(mesh_table.c.id == mesh_id, mesh_table.c.state != Status.READY.value)
    values = {"state": Status.FAILED.value, "reason": reason, "updated": micros(now())}
    await connection.execute(update(mesh_table).where(unfinished).values(**values))


def micros(moment: datetime) -> int:
    """A moment as the tables keep it."""
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds


def moment(value: int) -> datetime:
    """A moment from the tables."""
    seconds, rest = divmod(value, 1_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest)


def _values(mesh: MeshRecord) -> dict[str, Any]:
    box = [None] * 6 if mesh.box is None else [*mesh.box.minimum, *mesh.box.maximum]
    return {
        "name": mesh.name,
        "licence": mesh.licence,
        "state": mesh.state.value,
        "reason": mesh.reason,
        "stream_sha256": mesh.stream,
        "source_sha256": mesh.source,
        "size": mesh.size,
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "levels": mesh.levels,
        **dict(zip(BOX_COLUMNS, box, strict=True)),
        "search_text": "\n".join((mesh.id, mesh.name, *mesh.tags)).casefold(),
        "updated": micros(mesh.updated),
    }


async def _put_tags(connection: AsyncConnection, mesh: MeshRecord) -> None:
    if mesh.tags:
        await connection.execute(insert(tag_table), [{"mesh_id": mesh.id, "tag": tag} for tag in set(mesh.tags)])


async def _records(connection: AsyncConnection, rows: Sequence[RowMapping]) -> list[MeshRecord]:
    ids = [row["id"] for row in rows]
    tags: dict[str, list[str]] = {mesh_id: [] for mesh_id in ids}
    for mesh_id, tag in (await connection.execute(select(tag_table).where(tag_table.c.mesh_id.in_(ids)))).all():
        tags[mesh_id].append(tag)
    return [_record(row, tuple(sorted(tags[row["id"]]))) for row in rows]


def _record(row: RowMapping, tags: tuple[str, ...]) -> MeshRecord:
    x0, y0, z0, x1, y1, z1 = (row[name] for name in BOX_COLUMNS)
    return MeshRecord(
        id=row["id"],
        name=row["name"],
        tags=tags,
        licence=row["licence"],
        state=Status(row["state"]),
        reason=row["reason"],
        stream=row["stream_sha256"],
        source=row["source_sha256"],
        size=row["size"],
        vertices=row["vertices"],
        faces=row["faces"],
        levels=row["levels"],
        box=None if x0 is None else Box((x0, y0, z0), (x1, y1, z1)),
        created=moment(row["created"]),
        updated=moment(row["updated"]),
    )


def _conditions(query: MeshQuery) -> list[ColumnElement[bool]]:
    """What the rows of the meshes that were asked for fulfil."""
    table = mesh_table.c
    conditions = [table.search_text.contains(word, autoescape=True) for word in query.text.casefold().split()]
    conditions += [func.lower(table.licence).contains(word, autoescape=True) for word in query.licence.lower().split()]
    for tag in query.tags:
        conditions.append(table.id.in_(select(tag_table.c.mesh_id).where(tag_table.c.tag == tag)))
    bounds: list[tuple[Any, Callable[[Any, Any], Any], object]] = [
        (table.size, operator.ge, query.smallest),
        (table.size, operator.le, query.largest),
        (table.vertices, operator.ge, query.fewest_vertices),
        (table.vertices, operator.le, query.most_vertices),
        (table.levels, operator.ge, query.fewest_levels),
        (table.levels, operator.le, query.most_levels),
        (table.created, operator.gt, query.created_after and micros(query.created_after)),
        (table.created, operator.lt, query.created_before and micros(query.created_before)),
        (table.id, operator.gt, query.after or None),
        (table.state, operator.eq, query.status and Status(query.status).value),
    ]
    conditions += [compare(column, bound) for column, compare, bound in bounds if bound is not None]
    if query.box is not None:
        for axis, name in enumerate("xyz"):
            conditions.append(table[f"minimum_{name}"] <= query.box[3 + axis])
            conditions.append(table[f"maximum_{name}"] >= query.box[axis])
    return conditions
