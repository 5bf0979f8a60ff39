"""The catalogue and the folder answer the same question with the same meshes."""

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Box, Catalogue, MeshRecord, Status
from meshtide_server.hosting.published import shown
from meshtide_server.hosting.search import chosen

WORDS = st.text("aAbäÄßéÉ%_\\ '\"1-", max_size=6)
TAGS = st.sampled_from(["clay", "Clay", "bone", "a b"])
NUMBERS = st.integers(-3, 3).map(float)
MOMENTS = st.datetimes(datetime(2020, 1, 1), datetime(2020, 1, 3)).map(  # noqa: DTZ001 - UTC comes here
    lambda naive: naive.replace(hour=0, minute=0, second=0, microsecond=0, tzinfo=UTC)
)
BOXES = st.builds(
    lambda one, other: Box(
        tuple(map(min, one, other)),  # type: ignore[arg-type] # three of them
        tuple(map(max, one, other)),  # type: ignore[arg-type]
    ),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
)
RECORDS = st.lists(
    st.builds(
        MeshRecord,
        id=st.text("ab_-1", min_size=1, max_size=3),
        name=WORDS,
        tags=st.lists(TAGS, max_size=3).map(lambda tags: tuple(sorted(set(tags)))),
        licence=WORDS,
        state=st.sampled_from([Status.ENCODING, Status.FAILED]),
        box=st.none() | BOXES,
        created=MOMENTS,
        updated=MOMENTS,
    ),
    max_size=12,
    unique_by=lambda record: record.id,
)
SEARCHES = st.builds(
    MeshQuery,
    text=WORDS,
    tags=st.lists(TAGS, max_size=2).map(tuple),
    licence=WORDS,
    status=st.none() | st.sampled_from(list(Status)),
    box=st.none() | BOXES.map(lambda box: (*box.minimum, *box.maximum)),
    created_after=st.none() | MOMENTS,
    created_before=st.none() | MOMENTS,
    after=st.text("ab_-1", max_size=2),
)


@pytest.fixture
def runner(database_url: str) -> Iterator[tuple[asyncio.Runner, Catalogue]]:
    with asyncio.Runner() as loop:
        catalogue = loop.run(Catalogue.open(database_url))
        yield loop, catalogue
        loop.run(catalogue.close())


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(records=RECORDS, searches=st.lists(SEARCHES, min_size=1, max_size=6), page=st.integers(1, 5))
def test_catalogue_and_folder_agree(
    runner: tuple[asyncio.Runner, Catalogue], records: list[MeshRecord], searches: list[MeshQuery], page: int
) -> None:
    loop, catalogue = runner

    async def ids(query: MeshQuery) -> list[str]:
        found: list[str] = []
        while True:
            answer = await catalogue.meshes.list(query, page)
            assert len(answer.meshes) <= page
            found += [mesh.id for mesh in answer.meshes]
            if answer.next is None:
                return found
            query = replace(query, after=answer.next)

    async def compare() -> None:
        for record in records:
            await catalogue.meshes.add(record)
        meshes = sorted((shown(record) for record in records), key=lambda mesh: mesh.id)
        for search in searches:
            found = await ids(search)
            assert found == [mesh.id for mesh in chosen(search, meshes)], search
            assert all(first < second for first, second in pairwise(found))
        for record in records:
            await catalogue.delete(record.id)

    loop.run(compare())
