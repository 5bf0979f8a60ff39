from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.remote.ingest_plan import Ingested, IngestPlan, Sending, mesh_files
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True)
class Row:
    id: str
    name: str
    source: str | None
    status: str = "ready"


def digest(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()


@pytest.fixture(name="make")
def _make(tmp_path: Path) -> Callable[..., list[Path]]:
    """Writes files of the given contents."""

    def make(**contents: str) -> list[Path]:
        files = []
        for name, content in contents.items():
            path = tmp_path / name.replace("__", "/").replace("_", ".")
            path.parent.mkdir(exist_ok=True)
            path.write_text(content)
            files.append(path)
        return files

    return make


def decided(files: list[Path], known: list[Row], *, replace: bool = False) -> tuple[list[Sending], list[Ingested]]:
    told: list[Ingested] = []
    plan = IngestPlan(files, known, replace=replace, report=told.append)
    sent = list(plan.to_send())
    results = {row.file: row for row in (*told, *(Ingested(row.file, f"of-{row.file.name}", "done") for row in sent))}
    plan.report_twins(results)
    return sent, told


def test_folders_are_searched_and_files_are_taken_as_they_are_named(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("b.obj", "a.ply", "deep/c.tide", "notes.txt", "d.gltf", "e.gltf.gz", "f.stl.gz", "g.tide.gz"):
        (tmp_path / name).write_bytes(b"x")
    found = [str(file.relative_to(tmp_path)) for file in mesh_files([tmp_path, tmp_path / "notes.txt"])[0]]
    assert found == ["a.ply", "b.obj", "deep/c.tide", "f.stl.gz", "notes.txt"]
    assert len(mesh_files([tmp_path, tmp_path / "a.ply"])[0]) == 4


def test_what_is_no_file_is_skipped_with_a_word(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(b"x")
    (tmp_path / "dead.ply").symlink_to("gone.ply")
    os.mkfifo(tmp_path / "pipe.tide")
    files, skipped = mesh_files([tmp_path])
    assert files == [tmp_path / "a.ply"]
    assert skipped == [
        Ingested(tmp_path / "dead.ply", None, "skipped", "it is a link that leads nowhere"),
        Ingested(tmp_path / "pipe.tide", None, "skipped", "it is a pipe, no file"),
    ]
    (tmp_path / "a.ply").unlink()
    with pytest.raises(
        OptionError, match=r"no meshes to ingest: .*dead\.ply is a link that leads nowhere; .*is a pipe"
    ):
        mesh_files([tmp_path])
    for path, reason in (
        (tmp_path / "dead.ply", "is a link that leads nowhere"),
        (tmp_path / "pipe.tide", "is a pipe"),
    ):
        with pytest.raises(OptionError, match=reason):
            mesh_files([path])


def test_nothing_to_ingest_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no meshes"):
        mesh_files([tmp_path])
    with pytest.raises(OptionError, match="there is no file or folder"):
        mesh_files([tmp_path / "gone"])


def test_two_files_of_one_name_are_two_meshes_and_one_content_is_sent_once(make: Callable[..., list[Path]]) -> None:
    files = make(a__scan_ply="one", b__scan_ply="two", b__copy_ply="one")
    sent, told = decided(files, [])
    assert sent == [Sending(files[0], digest("one"), None), Sending(files[1], digest("two"), None)]
    assert told == [Ingested(files[2], "of-scan.ply", "kept")]


def test_what_is_there_is_known_by_its_content_not_by_its_name(make: Callable[..., list[Path]]) -> None:
    files = make(scan_ply="new", other_ply="old", third_ply="folder")
    known = [Row("scan", "scan.ply", digest("old")), Row("third", "third.ply", None)]
    sent, told = decided(files, known)
    assert [(row.file, row.mesh) for row in sent] == [(files[0], None), (files[2], None)]
    assert told == [Ingested(files[1], "scan", "kept")]


def test_what_failed_is_tried_again_under_its_id_unless_it_went_well_elsewhere(
    make: Callable[..., list[Path]],
) -> None:
    files = make(scan_ply="one", both_ply="two", now_ply="three")
    known = [
        Row("scan", "scan.ply", digest("one"), "failed"),
        Row("good", "both.ply", digest("two")),
        Row("bad", "both.ply", digest("two"), "failed"),
        Row("now", "now.ply", digest("three"), "encoding"),
    ]
    sent, told = decided(files, known)
    assert sent == [Sending(files[0], digest("one"), "scan")]
    assert told == [Ingested(files[1], "good", "kept"), Ingested(files[2], "now", "kept")]


def test_replacing_is_by_content_then_by_a_name_that_is_used_once(make: Callable[..., list[Path]]) -> None:
    files = make(renamed_ply="same", scan_ply="edited", a__twice_ply="x", b__twice_ply="y", plain_ply="z")
    known = [
        Row("first", "first.ply", digest("same")),
        Row("scan", "scan.ply", digest("before")),
        Row("twice", "twice.ply", digest("w")),
        Row("plain", "plain.ply", None),
    ]
    sent, told = decided(files, known, replace=True)
    assert [row.mesh for row in sent] == ["first", "scan", None, None, None]
    assert told == []


def test_no_mesh_is_replaced_by_two_files(make: Callable[..., list[Path]]) -> None:
    files = make(b_ply="new", c_ply="was b")
    sent, _ = decided(files, [Row("b", "b.ply", digest("was b"))], replace=True)
    assert [row.mesh for row in sent] == ["b", None]


def test_a_file_that_cannot_be_read_is_told_and_stops_no_other(make: Callable[..., list[Path]]) -> None:
    files = make(gone_ply="one", here_ply="two")
    files[0].unlink()
    sent, told = decided(files, [])
    assert [row.file for row in sent] == [files[1]]
    assert [(row.file, row.state) for row in told] == [(files[0], "failed")]
    assert "cannot be read" in (told[0].error or "")


@pytest.mark.parametrize("state", ["failed", "left"])
def test_a_twin_shares_the_failure(make: Callable[..., list[Path]], state: str) -> None:
    files = make(a_ply="one", b_ply="one")
    told: list[Ingested] = []
    plan = IngestPlan(files, [], replace=False, report=told.append)
    assert len(list(plan.to_send())) == 1
    plan.report_twins({files[0]: Ingested(files[0], None, state, "too large")})
    assert told == [Ingested(files[1], None, state, "too large")]


@given(contents=st.lists(st.sampled_from("abcde"), min_size=1, max_size=12), replace=st.booleans(), data=st.data())
def test_every_file_is_told_or_sent_and_no_content_twice(
    tmp_path_factory: pytest.TempPathFactory, contents: list[str], replace: bool, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("files")
    names = data.draw(st.lists(st.sampled_from(["x", "y", "z"]), min_size=len(contents), max_size=len(contents)))
    files = []
    for number, (name, content) in enumerate(zip(names, contents, strict=True)):
        (folder / str(number)).mkdir()
        files.append(folder / str(number) / f"{name}.ply")
        files[-1].write_text(content)
    status = st.sampled_from(["ready", "encoding", "failed"])
    rows = data.draw(st.lists(st.tuples(st.sampled_from("abcdefg"), st.sampled_from("xyz"), status), max_size=5))
    known = [Row(str(i), f"{name}.ply", digest(content), state) for i, (content, name, state) in enumerate(rows)]
    sent, told = decided(files, known, replace=replace)
    assert sorted([row.file for row in sent] + [row.file for row in told]) == sorted(files)
    assert len({row.digest for row in sent}) == len(sent)
    replaced = [row.mesh for row in sent if row.mesh is not None]
    assert len(set(replaced)) == len(replaced)
    there = {row.source for row in known if row.status != "failed"}
    assert replace or all(row.digest not in there for row in sent)


def test_names_are_compared_as_they_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "caf\udce9\n.ply"
    path.write_text("new")
    rows = [Row("cafe", r"caf\udce9\n.ply", digest("old"))]
    assert decided([path], rows, replace=True)[0] == [Sending(path, digest("new"), "cafe")]
