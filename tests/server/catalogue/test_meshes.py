from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Box, Catalogue, MeshExistsError, MeshRecord, Status, UnknownMeshError
from meshtide_server.catalogue.meshes import micros, moment


def mesh(number: int) -> MeshRecord:
    """A mesh that differs from others in everything."""
    return MeshRecord(
        id=f"mesh-{number}",
        name=f"Büste {number}.OBJ",
        tags=tuple(sorted({"all", "odd" if number % 2 else "even"})),
        licence=f"CC BY {number}.0",
        state=Status.READY,
        source=f"{number:064x}",
        size=1000 * number,
        vertices=100 * number,
        faces=200 * number,
        levels=number,
        box=Box((number, 0.0, 0.0), (number + 0.5, 1.0, 1.0)),
        created=datetime(2020, 1, number, tzinfo=UTC),
    )


async def found(catalogue: Catalogue, **query: object) -> list[int]:
    page = await catalogue.meshes.list(MeshQuery(**query))  # type: ignore[arg-type]
    return [int(each.id.removeprefix("mesh-")) for each in page.meshes]


async def test_what_was_added_is_there(catalogue: Catalogue) -> None:
    record = mesh(1)
    assert await catalogue.meshes.add(record) == record
    assert await catalogue.meshes.get("mesh-1") == record
    assert await catalogue.meshes.find_source(record.source or "") == record
    assert await catalogue.meshes.find_source("0" * 64) is None


async def test_ids_are_used_once(catalogue: Catalogue) -> None:
    await catalogue.meshes.add(mesh(1))
    with pytest.raises(MeshExistsError, match="there is a mesh 'mesh-1' already"):
        await catalogue.meshes.add(replace(mesh(2), id="mesh-1"))
    assert (await catalogue.meshes.get("mesh-1")).name == "Büste 1.OBJ"


async def test_putting_replaces_all_but_the_creation(catalogue: Catalogue) -> None:
    first = await catalogue.meshes.put(mesh(1))
    second = await catalogue.meshes.put(replace(mesh(2), id="mesh-1", tags=("new",)))
    assert second.created == first.created
    assert second.updated >= first.updated
    assert (second.name, second.tags, second.size) == ("Büste 2.OBJ", ("new",), 2000)
    assert await found(catalogue, tags=("all",)) == []


async def test_unknown_meshes_are_told(catalogue: Catalogue) -> None:
    with pytest.raises(UnknownMeshError, match="there is no mesh 'nothing'"):
        await catalogue.meshes.get("nothing")
    with pytest.raises(UnknownMeshError):
        await catalogue.delete("nothing")


async def test_search(catalogue: Catalogue) -> None:
    for number in range(1, 7):
        await catalogue.meshes.add(mesh(number))
    everything = [1, 2, 3, 4, 5, 6]
    assert await found(catalogue) == everything
    assert await found(catalogue, text="BÜSTE") == everything
    assert await found(catalogue, text="büste 3") == [3]
    assert await found(catalogue, text="obj ODD") == [1, 3, 5]
    assert await found(catalogue, text="%") == []
    assert await found(catalogue, text="_") == []
    assert await found(catalogue, tags=("even", "all")) == [2, 4, 6]
    assert await found(catalogue, tags=("even", "odd")) == []
    assert await found(catalogue, licence="cc 4.0") == [4]
    assert await found(catalogue, smallest=2000, largest=4000) == [2, 3, 4]
    assert await found(catalogue, fewest_vertices=500) == [5, 6]
    assert await found(catalogue, most_vertices=200) == [1, 2]
    assert await found(catalogue, fewest_levels=6) == [6]
    assert await found(catalogue, fewest_levels=2, most_levels=3) == [2, 3]
    assert await found(catalogue, box=(2.4, 0.5, 0.5, 4.0, 0.6, 0.6)) == [2, 3, 4]
    assert await found(catalogue, box=(0.0, 1.1, 0.0, 9.0, 2.0, 2.0)) == []
    assert await found(catalogue, created_after=datetime(2020, 1, 2, tzinfo=UTC)) == [3, 4, 5, 6]
    assert await found(catalogue, created_before=datetime(2020, 1, 2, tzinfo=UTC)) == [1]
    await catalogue.meshes.add(MeshRecord("mesh-7", "waiting"))
    assert await found(catalogue, status=Status.ENCODING) == [7]
    await catalogue.meshes.fail("mesh-7", "too odd")
    assert await found(catalogue, status=Status.READY) == everything
    assert (await catalogue.meshes.get("mesh-7")).reason == "too odd"
    assert await catalogue.meshes.count() == {Status.ENCODING: 0, Status.READY: 6, Status.FAILED: 1}


async def test_pages_follow_each_other_while_meshes_come_and_go(catalogue: Catalogue) -> None:
    for identifier in ("b", "a", "a-1", "a1", "a_1", "c", "z9"):
        await catalogue.meshes.add(MeshRecord(identifier, identifier))
    first = await catalogue.meshes.list(MeshQuery(), 3)
    assert [each.id for each in first.meshes] == ["a", "a-1", "a1"]
    await catalogue.delete("a1")
    await catalogue.meshes.add(MeshRecord("a0", "earlier"))
    second = await catalogue.meshes.list(MeshQuery(after=first.next or ""), 3)
    assert [each.id for each in second.meshes] == ["a_1", "b", "c"]
    third = await catalogue.meshes.list(MeshQuery(after=second.next or ""), 3)
    assert ([each.id for each in third.meshes], third.next) == (["z9"], None)


async def test_what_is_asked_of_many_at_once(catalogue: Catalogue) -> None:
    for identifier in ("scan", "scan-2", "scan-obj", "scam", "scao", "scan_", "scans"):
        await catalogue.meshes.add(MeshRecord(identifier, identifier))
    assert await catalogue.meshes.ids("scan") == ["scan", "scan-2", "scan-obj", "scan_", "scans"]
    assert await catalogue.meshes.ids("scant") == []
    first, second = await catalogue.meshes.get("scan"), await catalogue.meshes.put(MeshRecord("scam", "new"))
    assert await catalogue.meshes.updated(["scan", "scam", "gone"]) == {"scan": first.updated, "scam": second.updated}
    assert await catalogue.meshes.updated([]) == {}


@given(st.datetimes(min_value=datetime(1970, 1, 1), max_value=datetime(2200, 1, 1)))  # noqa: DTZ001 - UTC comes below
def test_moments_are_kept_exactly(naive: datetime) -> None:
    aware = naive.replace(tzinfo=UTC)
    assert moment(micros(aware)) == aware
    assert micros(aware + timedelta(microseconds=1)) == micros(aware) + 1
