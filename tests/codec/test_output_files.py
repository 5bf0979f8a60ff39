from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from meshtide_codec.output_files import (
    is_written_in_place,
    made_folder,
    move_into_place,
    write_atomically,
    write_output,
    write_together,
)

LONG_NAME = "n" * 255


def names(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


def test_a_symbolic_link_stays_and_what_it_names_is_written(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "real").write_bytes(b"old")
    link = tmp_path / "link"
    link.symlink_to(Path("elsewhere") / "real")
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert (elsewhere / "real").read_bytes() == b"new"
    assert names(elsewhere) == {"real"}
    dangling = tmp_path / "dangling"
    dangling.symlink_to(elsewhere / "coming")
    write_atomically(dangling, b"came", replace=False)
    assert (elsewhere / "coming").read_bytes() == b"came"


def test_a_loop_of_links_is_an_error_that_names_the_link(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError, match="symbolic links") as caught:
        write_atomically(tmp_path / "a", b"x")
    assert caught.value.filename == str(tmp_path / "a")


def test_a_pipe_is_written_in_place(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    link = tmp_path / "link"
    link.symlink_to(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_atomically(link, b"through", replace=False)
    reader.join(10)
    assert read == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert names(tmp_path) == {"pipe", "link"}


def test_a_terminal_is_written_in_place(tmp_path: Path) -> None:
    controller, terminal = os.openpty()
    link = tmp_path / "terminal"
    link.symlink_to(os.ttyname(terminal))
    write_atomically(link, b"shown")
    assert os.read(controller, 100) == b"shown"
    assert stat.S_ISCHR(link.stat().st_mode)
    os.close(controller)
    os.close(terminal)


@pytest.mark.parametrize("place", ["/dev/fd/{}", "/proc/self/fd/{}"])
def test_a_descriptor_is_written_where_it_stands_even_if_a_file_is_behind_it(tmp_path: Path, place: str) -> None:
    path = tmp_path / "appended"
    with path.open("wb") as file:
        file.write(b"first, ")
        file.flush()
        name = Path(place.format(file.fileno()))
        assert is_written_in_place(name)
        write_atomically(name, b"second", replace=False)
        file.seek(0, os.SEEK_END)
        file.write(b", third")
    assert path.read_bytes() == b"first, second, third"
    assert names(tmp_path) == {"appended"}


def test_standard_output_takes_what_is_written_to_its_name(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path; from meshtide_codec.output_files import write_atomically as w, write_output; "
        "w(Path('/dev/stdout'), b'a'); write_output('-', b'b'); w(Path('/dev/stdout'), b'c')"
    )
    path = tmp_path / "redirected"
    with path.open("wb") as file:
        file.write(b"0")
        file.flush()
        subprocess.run([sys.executable, "-c", code], stdout=file, check=True)
    assert path.read_bytes() == b"0abc"


def test_regular_files_folders_and_missing_ones_are_not_written_in_place(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert [is_written_in_place(tmp_path / name) for name in (".", "file", "missing")] == [False] * 3
    with pytest.raises(IsADirectoryError):
        write_atomically(tmp_path, b"x")


def test_permissions_of_the_file_that_is_replaced_stay(tmp_path: Path) -> None:
    path = tmp_path / "out"
    write_atomically(path, b"old")
    path.chmod(0o640)
    write_atomically(path, b"new")
    assert (stat.S_IMODE(path.stat().st_mode), path.read_bytes()) == (0o640, b"new")


def test_a_new_file_has_what_the_umask_leaves(tmp_path: Path) -> None:
    earlier = os.umask(0o027)
    try:
        write_atomically(tmp_path / "out", b"x")
    finally:
        os.umask(earlier)
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == 0o640


def test_the_longest_names_can_be_written(tmp_path: Path) -> None:
    write_atomically(tmp_path / LONG_NAME, b"x")
    assert names(tmp_path) == {LONG_NAME}


@pytest.mark.parametrize("call", ["open", "fsync", "replace"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_errors_name_the_file_of_the_user_and_leave_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int
) -> None:
    path = tmp_path / "out"
    path.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number), "some other name")

    with monkeypatch.context() as patched:
        patched.setattr(os if call == "fsync" else Path, call, fail)
        with pytest.raises(OSError, match=os.strerror(number)) as caught:
            write_atomically(path, b"new")
    assert (caught.value.errno, caught.value.filename) == (number, str(path))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == {"out"}


def test_a_name_that_is_too_long_or_in_no_folder_is_the_users(tmp_path: Path) -> None:
    for path in (tmp_path / (LONG_NAME + "n"), tmp_path / "missing" / "out"):
        with pytest.raises(OSError, match=r"too long|No such file") as caught:
            write_atomically(path, b"x")
        assert caught.value.filename == str(path)


def test_a_write_protected_file_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "out"
    path.write_bytes(b"kept")
    monkeypatch.setattr(os, "access", lambda *_: False)  # whoever runs the tests may write everything
    with pytest.raises(PermissionError, match="write-protected"):
        write_atomically(path, b"x")
    assert path.read_bytes() == b"kept"


@pytest.mark.parametrize("links", [True, False])
def test_one_of_many_writers_of_a_new_file_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    if not links:

        def no_links(*_: object) -> None:
            raise PermissionError(errno.EPERM, "this file system has none")

        monkeypatch.setattr(os, "link", no_links)
    path = tmp_path / "out"
    gate = threading.Barrier(8)
    won: list[int] = []
    lost: list[OSError] = []

    def write(number: int) -> None:
        gate.wait()
        try:
            write_atomically(path, b"%d" % number, replace=False)
            won.append(number)
        except FileExistsError as error:
            lost.append(error)

    writers = [threading.Thread(target=write, args=(number,)) for number in range(8)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert (len(won), len(lost)) == (1, 7)
    assert path.read_bytes() == b"%d" % won[0]
    assert names(tmp_path) == {"out"}
    assert {error.filename for error in lost} == {str(path)}


def test_a_file_that_was_written_already_gets_its_name_once(tmp_path: Path) -> None:
    for number in range(2):
        (tmp_path / f"part{number}").write_bytes(b"%d" % number)
    move_into_place(tmp_path / "part0", tmp_path / "out", replace=False)
    with pytest.raises(FileExistsError) as caught:
        move_into_place(tmp_path / "part1", tmp_path / "out", replace=False)
    assert caught.value.filename == str(tmp_path / "out")
    move_into_place(tmp_path / "part1", tmp_path / "out")
    assert (tmp_path / "out").read_bytes() == b"1"


def test_standard_output_is_a_hyphen(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    write_output("-", b"\x00\xff")
    assert capfdbinary.readouterr().out == b"\x00\xff"


SLOW = """
import os, sys, time
from pathlib import Path
from meshtide_codec import output_files
def slow(_):
    print("writing", flush=True)
    time.sleep(60)
output_files.os.fsync = slow
output_files.write_atomically(Path(sys.argv[1]), b"x")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_signal_leaves_the_old_file_and_nothing_else(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "out"
    path.write_bytes(b"old")
    process = subprocess.Popen([sys.executable, "-c", SLOW, path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert process.stdout is not None
    with process, process.stdout:
        assert process.stdout.readline() == b"writing\n"
        assert len(names(tmp_path)) == 2
        process.send_signal(number)
        assert process.wait(30) == (-number if number == signal.SIGINT else 128 + number)
    assert names(tmp_path) == {"out"}
    assert path.read_bytes() == b"old"


def test_files_that_belong_together_appear_together_or_not_at_all(tmp_path: Path) -> None:
    write_together([(tmp_path / "a", b"1"), (tmp_path / "b", b"2")])
    assert [(tmp_path / name).read_bytes() for name in "ab"] == [b"1", b"2"]
    (tmp_path / "folder").mkdir()
    for last in ("folder", "none/c"):
        with pytest.raises(OSError, match="director") as caught:
            write_together([(tmp_path / "a", b"3"), (tmp_path / "new", b"4"), (tmp_path / last, b"5")])
        assert caught.value.filename == str(tmp_path / last)
    with pytest.raises(FileExistsError):
        write_together([(tmp_path / "new", b"4"), (tmp_path / "b", b"5")], replace=False)
    assert (tmp_path / "a").read_bytes() == b"1"
    assert names(tmp_path) == {"a", "b", "folder"}


def test_a_folder_is_removed_again_if_nothing_came_into_it(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    for folder in ("kept", "kept/a/b", "c"):
        with pytest.raises(KeyboardInterrupt), made_folder(tmp_path / folder):
            assert (tmp_path / folder).is_dir()
            raise KeyboardInterrupt
    assert names(tmp_path) == {"kept"}
    assert names(tmp_path / "kept") == set()
    with pytest.raises(KeyboardInterrupt), made_folder(tmp_path / "c" / "d"):
        (tmp_path / "c" / "file").touch()
        raise KeyboardInterrupt
    assert names(tmp_path / "c") == {"file"}
    with made_folder(tmp_path / "e"):
        pass
    assert (tmp_path / "e").is_dir()
