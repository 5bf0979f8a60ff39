# ruff: noqa: ASYNC240 - the files of these tests are small
"""All meshes of a server as one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from meshtide_server.catalogue import Status
from meshtide_server.http.models import MeshSummary

from ..libraries import FakeEncoder, opened, settled
from ..made_streams import make_stream


async def test_good_and_bad_neighbours(
    folder: Path, encoders: list[FakeEncoder], caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "cut.tide").write_bytes(make_stream()[:-5])
    (folder / "foreign.tide").write_text("hello")
    (folder / "empty.tide").touch()
    (folder / "older.tide").write_bytes(make_stream()[:8] + b"\2\0" + make_stream()[10:])
    (folder / "bad.obj").touch()
    (folder / "Good One.PLY").touch()
    (folder / "notes.txt").touch()
    (folder / ".hidden.obj").touch()
    (folder / "folder.obj").mkdir()
    (folder / "dangling.obj").symlink_to(folder / "nowhere")
    async with opened(directory=folder) as library:
        assert await settled(library) == {
            "bad": Status.FAILED,
            "cut": Status.FAILED,
            "empty": Status.FAILED,
            "foreign": Status.FAILED,
            "good-one": Status.READY,
            "older": Status.FAILED,
            "small": Status.READY,
        }
        reasons = {mesh.id: mesh.reason for mesh in library.folder.meshes if mesh.reason}
        assert reasons["bad"] == "bad.obj: face 3 names vertex 99 of 8"
        assert "the file ends after" in reasons["cut"]
        assert "not a .tide file" in reasons["foreign"]
        assert "older meshtide (format 2): encode it again" in reasons["older"]
        assert "bad cannot be served" in caplog.text
    assert encoders[0].closed


async def test_ids_of_packed_files_are_without_both_suffixes(folder: Path, encoders: list[FakeEncoder]) -> None:
    for name in ("scan.obj.gz", "vase.PLY.gz", "vase.obj", "notes.gz"):
        (folder / name).touch()
    async with opened(directory=folder) as library:
        assert set(await settled(library)) == {"scan", "vase", "vase-obj", "small"}
    assert len(encoders) == 1


@pytest.mark.usefixtures("encoders")
async def test_files_of_one_stem_get_ids_of_their_own(folder: Path) -> None:
    for name in ("small.obj", "small.stl", "SMALL.obj"):
        (folder / name).write_text(name)
    async with opened(directory=folder) as library:
        assert set(await settled(library)) == {"small", "small-obj", "small-obj-2", "small-stl"}
        mesh = library.known("small")
        assert mesh is not None
        assert mesh.source.is_stream


@pytest.mark.usefixtures("encoders")
async def test_names_of_any_bytes_are_listed_in_printable_letters(folder: Path) -> None:
    for name in (b"caf\xe9.obj", b"a\nb.obj", b"\x1b[31mred.obj", "\u202eexe.obj".encode(), b"bad\xff.tide"):
        Path(os.fsdecode(os.fsencode(folder) + b"/" + name)).write_bytes(name)
    async with opened(directory=folder) as library:
        await settled(library)
        rows = [MeshSummary.of(mesh).model_dump_json() for mesh in library.folder.meshes]
        assert len(rows) == 6
        assert {mesh.source.name for mesh in library.folder.meshes} == {
            "small.tide", r"caf\udce9.obj", r"a\nb.obj", r"\x1b[31mred.obj", r"\u202eexe.obj", r"bad\udcff.tide"
        }  # fmt: skip
        statuses = [mesh.status for mesh in library.folder.meshes]
        assert (statuses.count(Status.READY), statuses.count(Status.FAILED)) == (5, 1)


async def test_samples(encoders: list[FakeEncoder], private_cache: Path) -> None:
    async with opened(samples=True) as library:
        assert await settled(library) == {"spot": Status.READY, "stanford-bunny": Status.READY}
    assert len(list(private_cache.rglob("samples/*.tide"))) == 2
    async with opened(samples=True) as library:
        await settled(library)
    assert encoders[1].jobs == []


@pytest.mark.usefixtures("encoders")
async def test_an_empty_folder_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with opened(directory=tmp_path) as library:
        assert await settled(library) == {}
    assert "there are no meshes in" in caplog.text
