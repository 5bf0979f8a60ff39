from __future__ import annotations

import asyncio
import os
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from meshtide_client.connection.link import Link
from meshtide_client.download.destination import Destination
from meshtide_client.download.fetch import FetchResult, fetch
from meshtide_codec.errors import OptionError, PacketError, TransferError
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.stream.container import preamble
from meshtide_codec.stream.session import Until
from streams import Served, encoded_grid

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


OTHER = encoded_grid(8).to_bytes()


@pytest.fixture(scope="module", name="source")
def _source() -> Served:
    return Served()


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


async def fetched(server: Any, *arguments: Any, **settings: Any) -> FetchResult:
    """`fetch` beside the server, in a thread."""
    return await asyncio.to_thread(lambda: fetch(server.url, *arguments, **settings))


async def test_a_mesh_is_fetched_and_written(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    output = tmp_path / "vase.ply"
    seen: list[int] = []
    progress: list[tuple[int, int]] = []
    async with serving(source) as server:
        result = await fetched(
            server,
            output,
            on_level=lambda level: seen.append(level.level),
            progress=lambda size, total: progress.append((size, total)),
        )
    expected = source.encoded.quantized.mesh()
    np.testing.assert_array_equal(result.mesh.vertices, expected.vertices)
    np.testing.assert_array_equal(result.mesh.faces, expected.faces)
    np.testing.assert_array_equal(load_mesh(output).faces, expected.faces)
    assert seen == [row.level for row in source.header.levels] == [figures.level for figures in result.levels]
    assert result.figures == result.levels[-1]
    assert not result.more
    assert result.header == source.header
    assert result.received_bytes == len(source.whole) - len(preamble(b""))
    assert progress[-1] == (len(source.whole), len(source.whole))
    assert progress == sorted(progress)
    assert names(tmp_path) == [output.name]


async def test_every_level_can_be_kept(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "levels"
    async with serving(source) as server:
        result = await fetched(server, keep_levels=folder)
    assert {file.name for file in folder.iterdir()} == {f"vase-level-{row.level}.ply" for row in source.header.levels}
    for figures in result.levels:
        assert len(load_mesh(folder / f"vase-level-{figures.level}.ply").faces) == figures.faces


async def test_until_limits_what_comes(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    output = tmp_path / "vase.obj"
    progress: list[tuple[int, int]] = []
    async with serving(source) as server:
        result = await fetched(
            server, output, until=Until(level=1), progress=lambda size, total: progress.append((size, total))
        )
    assert result.figures.level == 1
    assert result.more
    assert progress[-1] == (result.figures.size, result.figures.size)
    assert len(load_mesh(output).faces) == result.figures.faces


async def test_a_bound_below_the_coarsest_level_is_told(serving: Callable[..., Any], source: Served) -> None:
    least = len(preamble(source.header_bytes)) + source.header.packets[0].length
    async with serving(source) as server:
        with pytest.raises(OptionError, match=f"the coarsest takes {least} bytes"):
            await fetched(server, until=Until(size=least - 1))
        assert (await fetched(server, until=Until(size=least))).figures.size == least


async def test_a_broken_download_is_gone_on_with(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    output = tmp_path / "vase.ply"
    output.write_text("what was here before")
    partial = tmp_path / "vase.ply.partial.tide"
    async with serving(source, cuts=[5]) as server:
        with pytest.raises(TransferError, match="vase.ply.partial.tide, and the same request goes on from there"):
            await fetched(server, output, link=Link(retries=0))
        assert source.whole.startswith(partial.read_bytes())
        assert output.read_text() == "what was here before"
        result = await fetched(server, output)
    assert server.finished_packets == list(range(len(source.header.packets)))
    assert result.received_bytes < len(source.whole)
    assert names(tmp_path) == [output.name]


async def test_a_stream_file_stays_and_is_used(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    stream_file = tmp_path / "vase.tide"
    async with serving(source) as server:
        await fetched(server, until=Until(level=1), stream_file=stream_file)
        await fetched(server, stream_file=stream_file)
        again = await fetched(server, stream_file=stream_file)
    assert stream_file.read_bytes() == source.whole
    assert again.received_bytes == 0
    assert server.finished_packets == list(range(len(source.header.packets)))


async def test_the_partial_file_stays_when_the_output_cannot_be_written(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    output = tmp_path / "vase.ply"
    async with serving(source) as server:
        with pytest.raises(OSError, match="directory") as caught:
            await fetched(server, output, on_level=lambda _: output.mkdir(exist_ok=True))
    assert caught.value.filename == str(output)
    assert (tmp_path / "vase.ply.partial.tide").read_bytes() == source.whole


async def test_a_stream_file_of_another_mesh_is_left_alone(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    other, told = tmp_path / "other.tide", list[str]()
    other.write_bytes(OTHER)
    async with serving(source) as server:
        with pytest.raises(OptionError, match=r"other\.tide is there already, and holds another stream"):
            await fetched(server, stream_file=other, overwrite=False, notify=told.append)
        assert (names(tmp_path), other.read_bytes(), told) == (["other.tide"], OTHER, [])
        await fetched(server, stream_file=other, overwrite=True)
        assert names(tmp_path) == ["other.tide", "other.tide.old1"]
        again = await fetched(server, stream_file=other, overwrite=False)
    assert again.received_bytes == 0
    assert other.read_bytes() == source.whole


async def test_what_is_no_regular_file_takes_ply_or_the_format_that_is_named(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    written: list[bytes] = []
    async with serving(source) as server:
        for kind in (None, "obj"):
            reader = threading.Thread(target=lambda: written.append(pipe.read_bytes()))
            reader.start()
            await fetched(server, pipe, kind=kind, overwrite=False)
            reader.join(60)
        await fetched(server, tmp_path / "nameless", kind="off")
        await fetched(server, "/dev/null", overwrite=False)
    assert written[0].startswith(b"ply\n")
    assert written[1].count(b"\nf ") == source.header.faces
    assert (tmp_path / "nameless").read_bytes().startswith(b"OFF")
    assert names(tmp_path) == ["nameless", "pipe"]
    with pytest.raises(OptionError, match="is not a regular file"):
        fetch(NOWHERE, stream_file="/dev/null")
    with pytest.raises(OptionError, match="docx is none of the formats"):
        fetch(NOWHERE, tmp_path / "a.ply", kind="docx")


def test_an_unknown_format_is_told_before_anything_is_fetched(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"its name must end with one of \.obj"):
        fetch("http://127.0.0.1:9/meshes/vase", tmp_path / "vase.docx")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_told_before_anything_is_fetched(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="there is no folder") as caught:
        fetch("http://127.0.0.1:9/meshes/vase", tmp_path / "none" / "vase.ply")
    assert "partial" not in str(caught.value)


NOWHERE = "http://127.0.0.1:9/meshes/vase"


def test_files_that_are_there_are_refused_before_anything_is_fetched(tmp_path: Path) -> None:
    for name in ("vase.ply", "vase-level-3.ply", "notes.tide", "pot.ply.partial.tide"):
        (tmp_path / name).write_text("kept")
    for settings in (
        {"output": tmp_path / "vase.ply"},
        {"keep_levels": tmp_path},
        {"stream_file": tmp_path / "notes.tide"},
        {"output": tmp_path / "pot.ply"},
        {"output": tmp_path},
        {"keep_levels": tmp_path / "vase.ply"},
    ):
        with pytest.raises(OptionError):
            fetch(NOWHERE, overwrite=False, **settings)  # type: ignore[arg-type]
    with pytest.raises(TransferError, match="Connection refused"):
        fetch(NOWHERE, tmp_path / "vase.ply", keep_levels=tmp_path, overwrite=True)
    assert {path.read_text() for path in tmp_path.iterdir()} == {"kept"}
    assert len(names(tmp_path)) == 4


def test_a_file_of_this_machine_is_not_written_while_it_is_read(source: Served, tmp_path: Path) -> None:
    stream = tmp_path / "vase.ply.partial.tide"
    stream.write_bytes(source.whole)
    (tmp_path / "link.tide").symlink_to(stream)
    os.link(stream, tmp_path / "hard.tide")
    (tmp_path / "vase.ply").symlink_to(stream)
    for settings in (
        {"output": tmp_path / "vase.ply"},
        {"stream_file": tmp_path / "link.tide"},
        {"stream_file": tmp_path / "hard.tide"},
        {"stream_file": stream},
    ):
        with pytest.raises(OptionError, match="is what is read"):
            fetch(str(stream), **settings)  # type: ignore[arg-type]
    (tmp_path / "vase.ply").unlink()
    fetch(str(stream), tmp_path / "vase.ply")  # whose partial file would be the source
    assert stream.read_bytes() == source.whole
    with pytest.raises(OptionError, match="would be written twice"):
        fetch(NOWHERE, tmp_path / "both.ply", stream_file=tmp_path / "both.ply")


async def test_an_output_that_came_meanwhile_stays(serving: Callable[..., Any], source: Served, tmp_path: Path) -> None:
    output = tmp_path / "vase.ply"
    async with serving(source) as server:
        with pytest.raises(FileExistsError, match="in the meantime") as caught:
            await fetched(server, output, overwrite=False, on_level=lambda _: output.write_text("of another"))
    assert caught.value.filename == str(output)
    assert output.read_text() == "of another"


async def test_a_fetch_goes_on_without_a_word_and_replaces_with_one(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    output = tmp_path / "vase.ply"
    (tmp_path / "vase.ply.partial.tide").write_bytes(source.whole[: len(source.whole) // 2])
    async with serving(source) as server:
        result = await fetched(server, output, overwrite=False)
        assert result.received_bytes < len(source.whole) // 2 + 1000
        with pytest.raises(OptionError, match="add --overwrite"):
            await fetched(server, output, overwrite=False)
        output.write_text("older")
        await fetched(server, output, keep_levels=tmp_path / "levels", overwrite=True)
        await fetched(server, output, keep_levels=tmp_path / "more", overwrite=True)
    assert len(load_mesh(output).vertices) == result.figures.vertices
    assert names(tmp_path) == ["levels", "more", "vase.ply"]


async def test_levels_of_a_first_fetch_may_come_in_several_states(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    async with serving(source) as server:
        result = await fetched(server, keep_levels=tmp_path / "levels", overwrite=False)
        with pytest.raises(OptionError, match="is there already"):
            await fetched(server, keep_levels=tmp_path / "levels", overwrite=False)
    assert len(names(tmp_path / "levels")) == len({figures.level for figures in result.levels})


def test_the_partial_file_of_a_long_name_is_short_enough(tmp_path: Path) -> None:
    lengths = {}
    for length in (100, 242, 243, 251):
        path = Destination(tmp_path / ("n" * length + ".ply")).partial_path
        assert path is not None
        path.touch()
        lengths[length] = len(path.name)
    assert lengths == {100: 117, 242: 45, 243: 45, 251: 45}
    assert len(names(tmp_path)) == 4


def test_nothing_is_left_when_there_is_no_server(tmp_path: Path) -> None:
    with pytest.raises(TransferError, match="Connection refused"):
        fetch("http://127.0.0.1:9/meshes/vase", tmp_path / "vase.ply")
    assert list(tmp_path.iterdir()) == []


async def test_it_works_where_an_event_loop_runs_already(tmp_path: Path) -> None:
    with pytest.raises(TransferError, match="Connection refused"):
        fetch("http://127.0.0.1:9/meshes/vase", tmp_path / "vase.ply")


def test_where_packets_are_kept(tmp_path: Path) -> None:
    output, stream_file = tmp_path / "a.ply", tmp_path / "b.tide"
    assert Destination().partial_path is None
    assert Destination(output).partial_path == tmp_path / "a.ply.partial.tide"
    assert Destination(output, stream_file).partial_path == stream_file
    assert os.fspath(Destination(None, stream_file).partial_path or "") == str(stream_file)


def test_a_damaged_file_of_this_machine_promises_nothing_and_leaves_nothing(source: Served, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.tide"
    damaged.write_bytes(source.whole[:-1] + bytes([source.whole[-1] ^ 1]))
    with pytest.raises(PacketError, match="checksum") as caught:
        fetch(str(damaged), tmp_path / "a.ply", keep_levels=tmp_path / "levels" / "below")
    assert "goes on" not in str(caught.value)
    assert "kept" not in str(caught.value)
    assert names(tmp_path) == ["damaged.tide", "levels"]  # whose levels are whole
    with pytest.raises(PacketError, match="what has arrived is kept in .*kept.tide$"):
        fetch(str(damaged), tmp_path / "a.ply", stream_file=tmp_path / "kept.tide")


def test_levels_that_did_not_come_leave_no_folder(tmp_path: Path) -> None:
    with pytest.raises(TransferError):
        fetch(NOWHERE, keep_levels=tmp_path / "a" / "b", link=Link(retries=0))
    assert names(tmp_path) == []


def test_a_level_that_the_stream_does_not_have_is_told(source: Served, tmp_path: Path) -> None:
    (tmp_path / "a.tide").write_bytes(source.whole)
    coarsest = source.header.levels[0].level
    told_of_99 = [f"the stream has levels 0 to {coarsest}, and not 99: the coarsest is fetched"]
    for level, told in ((99, told_of_99), (coarsest, [])):
        sentences: list[str] = []
        result = fetch(str(tmp_path / "a.tide"), until=Until(level=level), notify=sentences.append)
        assert result.figures.level == coarsest
        assert sentences == told
