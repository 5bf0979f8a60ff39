"""`meshtide demo`: a server, a mesh that arrives from it, and nothing left running."""

from __future__ import annotations

import re
import signal
import struct
import time
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client.remote.listing import list_meshes
from meshtide_codec.command_line import ExitCode
from meshtide_codec.errors import TransferError
from meshtide_codec.mesh_files import load_mesh

if TYPE_CHECKING:
    import subprocess


def announced(process: subprocess.Popen[str]) -> str:
    """The URL of the demo's server."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("it listens on "):
            return line.removeprefix("it listens on ").strip()
    raise AssertionError(process.communicate())


def test_the_demo_leaves_every_level_and_a_picture(meshtide: Any) -> None:
    done = meshtide("demo", "--mesh", "spot", "--output", "tide")
    assert done.returncode == ExitCode.OK, done.stderr
    assert "the finest level is the quantized input (B = 12 bits per coordinate), exactly" in done.stdout
    files = {path.name for path in (meshtide.folder / "tide").iterdir()}
    numbers = sorted(int(re.fullmatch(r"spot-level-(\d+)\.ply", name)[1]) for name in files - {"levels.png"})  # type: ignore[index]
    assert len(numbers) >= 3
    assert numbers[0] == 0
    levels = [f"spot-level-{number}.ply" for number in numbers]
    sizes = [len(load_mesh(meshtide.folder / "tide" / name).faces) for name in levels]
    assert sizes == sorted(sizes, reverse=True)
    assert all(str(size) in done.stdout for size in sizes)
    picture = (meshtide.folder / "tide" / "levels.png").read_bytes()
    assert struct.unpack_from(">2I", picture, 16) == (3 * 360, -(-len(levels) // 3) * 388)
    assert files == {*levels, "levels.png"}


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, ExitCode.INTERRUPTED), (signal.SIGTERM, 128 + signal.SIGTERM)]
)
def test_the_server_does_not_outlive_an_interrupted_demo(meshtide: Any, number: int, code: int) -> None:
    process = meshtide.start("demo", "--mesh", "spot", "--rate", "200", "--no-picture")
    url = announced(process)
    assert list_meshes(url)
    time.sleep(0.5)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code
    assert "Traceback" not in errors
    with pytest.raises(TransferError):
        list_meshes(url)


def test_a_sample_that_does_not_exist(meshtide: Any) -> None:
    done = meshtide("demo", "--mesh", "teapot")
    assert done.returncode == ExitCode.USAGE
    assert "there are spot, stanford-bunny" in done.stderr
    assert meshtide.files == set()


def test_a_rate_that_makes_no_sense(meshtide: Any) -> None:
    done = meshtide("demo", "--rate", "0")
    assert done.returncode == ExitCode.USAGE
    assert meshtide.files == set()
