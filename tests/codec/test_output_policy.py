from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import OptionError
from meshtide_codec.output_policy import check_apart, check_different, is_same_file, output_file, output_folder


def refused(path: Path, *inputs: Path | str, **options: bool) -> str:
    with pytest.raises(OptionError) as caught:
        output_file(path, inputs, **options)
    return str(caught.value)


@pytest.fixture(name="mesh")
def _mesh(tmp_path: Path) -> Path:
    path = tmp_path / "mesh.ply"
    path.write_bytes(b"a mesh")
    return path


def test_a_new_file_may_be_written_and_nothing_is_made_by_asking(mesh: Path) -> None:
    target = output_file(mesh.with_suffix(".tide"), [mesh])
    assert not target.replace
    assert not target.replaces
    assert [entry.name for entry in mesh.parent.iterdir()] == ["mesh.ply"]
    target.write(b"stream")
    assert mesh.with_suffix(".tide").read_bytes() == b"stream"


def test_an_input_is_refused_whatever_it_is_called(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = mesh.parent
    (folder / "link").symlink_to(mesh)
    os.link(mesh, folder / "hard")
    (folder / "here").symlink_to(folder)
    monkeypatch.chdir(folder)
    spellings = [
        mesh,
        Path("mesh.ply"),
        folder / "here" / ".." / folder.name / "mesh.ply",
        folder / "here" / "mesh.ply",
        folder / "link",
        folder / "hard",
    ]
    for output in spellings:
        for source in spellings:
            for overwrite in (False, True):
                assert "is what is read" in refused(output, source, overwrite=overwrite)
    assert mesh.read_bytes() == b"a mesh"


def test_an_output_that_is_not_there_yet_can_be_another_ones_name(tmp_path: Path) -> None:
    (tmp_path / "here").symlink_to(tmp_path)
    assert is_same_file(tmp_path / "here" / "new", tmp_path / "new")
    assert not is_same_file(tmp_path / "new", tmp_path / "old")
    assert not is_same_file(tmp_path / "new", "no\0name")
    check_apart(tmp_path / "new", tmp_path / "old")
    check_apart(tmp_path / "new", None)
    with pytest.raises(OptionError, match="would be written twice"):
        check_apart(tmp_path / "here" / "new", tmp_path / "new")


def test_an_existing_file_needs_a_word(mesh: Path) -> None:
    assert "add --overwrite" in refused(mesh)
    assert output_file(mesh, overwrite=True).replace
    own = output_file(mesh, own=lambda path: path == mesh)
    assert own.replace
    assert own.replaces
    assert "there already" in refused(mesh.parent / "mesh.ply")


def test_a_file_that_comes_meanwhile_stays(tmp_path: Path) -> None:
    target = output_file(tmp_path / "out")
    (tmp_path / "out").write_bytes(b"of another")
    with pytest.raises(FileExistsError):
        target.write(b"mine")
    assert (tmp_path / "out").read_bytes() == b"of another"


def test_folders_and_missing_folders_are_told_before_the_work(tmp_path: Path, mesh: Path) -> None:
    assert "is a folder; name a file" in refused(tmp_path)
    assert f"there is no folder {tmp_path / 'missing'}" in refused(tmp_path / "missing" / "out")
    assert "is no folder" in refused(mesh / "out")
    (tmp_path / "dangling").symlink_to(tmp_path / "gone" / "out")
    assert f"no folder {tmp_path / 'gone'}" in refused(tmp_path / "dangling")
    assert output_file(tmp_path / "missing" / "out", new_folder=True).path.name == "out"
    with pytest.raises(OSError, match="too long"):
        output_file(tmp_path / ("n" * 256))


def test_what_cannot_be_written_is_told_before_the_work(
    tmp_path: Path, mesh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path)
    with pytest.raises(PermissionError, match="nothing can be written into the folder") as caught:
        output_file(tmp_path / "out")
    assert caught.value.filename == str(tmp_path / "out")
    with pytest.raises(PermissionError, match="nothing can be written"):
        output_folder(tmp_path / "new" / "folder")
    monkeypatch.setattr(os, "access", lambda path, _mode: path != mesh)
    with pytest.raises(PermissionError, match="write-protected"):
        output_file(mesh, overwrite=True)


def test_pipes_are_written_without_a_word(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    target = output_file(tmp_path / "pipe")
    assert target.replace
    assert not target.replaces


def test_a_hyphen_is_standard_output_where_it_makes_sense(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.chdir(tmp_path)
    target = output_file(Path("-"), standard_output=True)
    assert target.is_standard_output
    target.write(b"bytes")
    assert capfdbinary.readouterr().out == b"bytes"
    assert "does not write to standard output" in refused(Path("-"))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert "is a terminal" in refused(Path("-"), standard_output=True)


def test_a_folder_can_be_made_but_not_of_a_file(tmp_path: Path, mesh: Path) -> None:
    output_folder(tmp_path / "a" / "b")
    assert not (tmp_path / "a").exists()
    for folder in (mesh, mesh / "below"):
        with pytest.raises(OptionError, match="is a file; name a folder"):
            output_folder(folder)


@pytest.mark.parametrize(("one", "other"), [("a", "a"), ("A", "a"), ("caf\u00e9", "cafe\u0301"), ("STRASSE", "straße")])
def test_sources_that_lead_to_one_name_are_both_named(one: str, other: str) -> None:
    with pytest.raises(OptionError, match=r"first\.obj and .*second\.ply would both become"):
        check_different([(one, "first.obj"), ("b", "third.off"), (other, Path("second.ply"))])


@given(st.lists(st.text(st.characters(max_codepoint=127), min_size=1, max_size=5), unique_by=str.lower, max_size=8))
def test_different_names_are_taken_and_a_source_may_come_twice(names: list[str]) -> None:
    check_different((name, f"{name}.obj") for name in names)
    check_different((name, name) for name in [*names, *names])


def test_names_in_messages_are_shown_escaped(tmp_path: Path) -> None:
    path = tmp_path / "\x1b[31m\udcff"
    path.touch()
    assert r"\x1b[31m\udcff is there already" in refused(path)
