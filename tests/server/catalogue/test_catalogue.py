import asyncio
from datetime import timedelta

import pytest

from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Catalogue, MeshExistsError, MeshRecord, Status, StreamRecord, UnknownMeshError
from meshtide_server.catalogue.rows import MeshDescription

from ..catalogues import stream_record

NO_TIME = timedelta(0)


class Objects:
    """Stands for the store."""

    def __init__(self) -> None:
        self.there: set[str] = set()

    async def remove(self, sha256: str) -> None:
        self.there.discard(sha256)


@pytest.fixture
def objects() -> Objects:
    return Objects()


async def shown(catalogue: Catalogue, objects: Objects, mesh_id: str, stream: StreamRecord) -> MeshRecord | None:
    await catalogue.streams.note_unused(stream.sha256)
    objects.there.add(stream.sha256)

    async def present() -> bool:
        return stream.sha256 in objects.there

    mesh = MeshRecord(mesh_id, mesh_id, state=Status.READY, stream=stream.sha256)
    return await catalogue.register(mesh, stream, present)


async def test_a_registered_stream_is_found_by_itself_and_by_its_packets(
    catalogue: Catalogue, objects: Objects
) -> None:
    stream = stream_record()
    assert await shown(catalogue, objects, "a", stream) is not None
    assert await catalogue.streams.get(stream.sha256) == stream
    assert await catalogue.streams.get("0" * 64) is None
    assert await catalogue.streams.present([stream.sha256, "0" * 64]) == {stream.sha256}
    for position, digest in enumerate(stream.packets):
        place = await catalogue.streams.find_packet(digest.hex())
        assert place is not None
        assert (place.stream, place.position) == (stream.sha256, position)
    assert place.offset + place.length == stream.size
    assert await catalogue.streams.find_packet("0" * 64) is None
    assert await catalogue.streams.unused(NO_TIME) == []


async def test_streams_stay_as_long_as_a_mesh_has_them(catalogue: Catalogue, objects: Objects) -> None:
    stream = stream_record()
    await shown(catalogue, objects, "a", stream)
    await shown(catalogue, objects, "b", stream)
    await catalogue.delete("a")
    assert await catalogue.collect(objects.remove, NO_TIME) == []
    assert await catalogue.streams.get(stream.sha256) == stream
    await catalogue.delete("b")
    assert await catalogue.streams.get(stream.sha256) is None
    assert await catalogue.streams.find_packet(stream.packets[0].hex()) is None
    assert await catalogue.collect(objects.remove) == []  # readers may still be at it
    assert await catalogue.collect(objects.remove, NO_TIME) == [stream.sha256]
    assert objects.there == set()
    assert await catalogue.collect(objects.remove, NO_TIME) == []


async def test_a_replaced_stream_is_collected(catalogue: Catalogue, objects: Objects) -> None:
    first, second, third = (stream_record(seed) for seed in range(3))
    await shown(catalogue, objects, "a", first)
    await shown(catalogue, objects, "a", second)
    assert await catalogue.collect(objects.remove, NO_TIME) == [first.sha256]
    await catalogue.meshes.put(MeshRecord("a", "a"))
    await shown(catalogue, objects, "a", third)
    assert await catalogue.collect(objects.remove, NO_TIME) == [second.sha256]
    assert objects.there == {third.sha256}


async def test_an_object_whose_putting_was_cut_off_is_collected(catalogue: Catalogue, objects: Objects) -> None:
    stream = stream_record()
    await catalogue.streams.note_unused(stream.sha256)
    objects.there.add(stream.sha256)
    assert await catalogue.collect(objects.remove, timedelta(minutes=1)) == []
    assert await catalogue.collect(objects.remove, NO_TIME) == [stream.sha256]


async def test_nothing_is_shown_whose_object_is_missing(catalogue: Catalogue) -> None:
    stream = stream_record()

    async def absent() -> bool:
        return False

    mesh = MeshRecord("a", "a", state=Status.READY, stream=stream.sha256)
    assert await catalogue.register(mesh, stream, absent) is None
    with pytest.raises(UnknownMeshError):
        await catalogue.meshes.get("a")
    assert await catalogue.streams.get(stream.sha256) is None


async def test_registering_and_collecting_at_once_never_loses_an_object(catalogue: Catalogue, objects: Objects) -> None:
    stream = stream_record()

    async def publish() -> None:
        for _ in range(8):
            if await shown(catalogue, objects, "a", stream) is not None:  # else it was collected in between
                assert stream.sha256 in objects.there
                await catalogue.delete("a")

    async def collect() -> None:
        for _ in range(20):
            await catalogue.collect(objects.remove, NO_TIME)

    await asyncio.gather(publish(), collect(), collect())
    assert await shown(catalogue, objects, "a", stream) is not None
    await catalogue.collect(objects.remove, NO_TIME)
    assert stream.sha256 in objects.there


async def test_a_job_ends_with_what_it_made(catalogue: Catalogue) -> None:
    stream = stream_record()
    _, job = await catalogue.add_with_job(MeshRecord("a", "a"), "sources/a.obj", {})
    mesh = MeshRecord("a", "a", state=Status.READY, stream=stream.sha256)

    async def present() -> bool:
        return True

    await catalogue.jobs.claim("me")
    with pytest.raises(UnknownMeshError):
        await catalogue.register(mesh, stream, present, job=(job.id, "you"))
    assert (await catalogue.meshes.get("a")).state == Status.ENCODING
    with pytest.raises(MeshExistsError):
        await catalogue.register(mesh, stream, present, replace=False)
    assert await catalogue.register(mesh, stream, present, job=(job.id, "me")) is not None
    assert (await catalogue.jobs.get(job.id)).progress == 1.0
    assert (await catalogue.meshes.get("a")).state == Status.READY


async def test_a_catalogue_answers_until_it_is_closed(catalogue: Catalogue) -> None:
    await catalogue.check()
    await catalogue.close()
    await catalogue.close()


async def test_what_is_told_of_a_mesh_can_be_changed(catalogue: Catalogue, objects: Objects) -> None:
    stream = stream_record()
    before = await shown(catalogue, objects, "a", stream)
    assert before is not None
    changed = await catalogue.change("a", tags=("new", "scan"), licence="CC0")
    assert (changed.name, changed.tags, changed.licence) == (before.name, ("new", "scan"), "CC0")
    assert (changed.stream, changed.created, changed.state) == (stream.sha256, before.created, Status.READY)
    assert changed.updated > before.updated
    assert (await catalogue.change("a", name="better")).tags == ("new", "scan")
    assert [mesh.id for mesh in (await catalogue.meshes.list(MeshQuery(text="better new"))).meshes] == ["a"]
    assert (await catalogue.change("a", tags=())).tags == ()
    await catalogue.meshes.add(MeshRecord("b", "b.obj", ("old",)))
    assert (await catalogue.change("b", tags=("new",))).tags == ("old",)  # it is being encoded
    with pytest.raises(UnknownMeshError):
        await catalogue.change("c", name="c")


async def test_a_change_and_an_upload_at_once_leave_the_upload(catalogue: Catalogue, objects: Objects) -> None:
    for turn in range(20):
        mesh_id = f"mesh-{turn}"
        await shown(catalogue, objects, mesh_id, stream_record())
        upload = catalogue.add_with_job(MeshRecord(mesh_id, "new.obj", ("new",)), "sources/a.obj", {}, replace=True)
        await asyncio.gather(catalogue.change(mesh_id, licence="CC0"), upload)
        mesh = await catalogue.meshes.get(mesh_id)
        assert (mesh.state, mesh.stream is None) == (Status.READY, False)  # until the job is done
        (job,) = await catalogue.jobs.list(mesh_id=mesh_id)
        assert job.description == MeshDescription("new.obj", ("new",), "", None)
        again = await catalogue.change(mesh_id, licence="MIT")
        assert (again.state, again.licence == "MIT") == (Status.ENCODING, False)  # the job brings all of this
        claimed = await catalogue.jobs.claim("worker")
        assert claimed is not None
        await catalogue.jobs.fail(claimed.id, "worker", "no mesh", retry=False)
        assert (await catalogue.meshes.get(mesh_id)) == mesh
        assert (await catalogue.change(mesh_id, licence="MIT")).licence == "MIT"


async def test_tags_are_counted(catalogue: Catalogue) -> None:
    for mesh_id, tags in (("a", ("clay", "scan")), ("b", ("scan",)), ("c", ("bone", "scan")), ("d", ())):
        await catalogue.meshes.add(MeshRecord(mesh_id, mesh_id, tags))
    assert await catalogue.meshes.tags(10) == [("scan", 3), ("bone", 1), ("clay", 1)]
    assert await catalogue.meshes.tags(1) == [("scan", 3)]
