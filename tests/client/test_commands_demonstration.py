from __future__ import annotations

import io
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rich.console import Console

from meshtide_client.commands import demonstration as demo
from meshtide_client.commands.demonstration import MismatchError, run_demo
from meshtide_client.remote.listing import ListedMesh
from meshtide_codec.errors import OptionError, TransferError
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize
from meshtide_codec.samples import load_sample

if TYPE_CHECKING:
    from pathlib import Path


def hosted(status: str, *, progress: float = 0.5, reason: str | None = None) -> ListedMesh:
    return ListedMesh("spot", "spot", status, "levels", progress, reason, None, None, None, None)


def waited(monkeypatch: pytest.MonkeyPatch, answers: list[ListedMesh], wait: float = 60.0) -> str:
    """What is written while the server gives these answers, one after the other."""
    console = Console(file=io.StringIO(), width=120)
    monkeypatch.setattr(demo, "list_meshes", lambda _url: (answers.pop(0) if len(answers) > 1 else answers[0],))
    monkeypatch.setattr(demo, "_POLL_SECONDS", 0.01)
    demo._wait_until_ready(console, "http://h", "spot", wait)
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


def test_a_server_that_still_encodes_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert waited(monkeypatch, [hosted("encoding"), hosted("encoding"), hosted("ready")]) == ""


def test_a_long_wait_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "_PATIENCE_SECONDS", 0.005)
    text = waited(monkeypatch, [hosted("encoding")] * 4 + [hosted("ready")])
    assert text == "the server encodes spot ...\n"


def test_a_wait_that_is_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(TransferError, match=r"not encoded within 0\.05 seconds; allow more with --wait"):
        waited(monkeypatch, [hosted("encoding")], wait=0.05)


def test_a_server_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(TransferError, match="could not encode spot: out of memory"):
        waited(monkeypatch, [hosted("failed", reason="out of memory")])


def test_a_server_without_the_sample_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    other = ListedMesh("cup", "cup", "ready", None, 1.0, None, 1, 1, 1, 1)
    with pytest.raises(TransferError, match="does not host spot"):
        waited(monkeypatch, [other])


def test_the_check_passes_only_on_the_very_mesh() -> None:
    exact = quantize(load_sample("spot"), 12).mesh()
    moved = exact.vertices.copy()
    moved[7, 1] = np.nextafter(moved[7, 1], np.inf)
    header = SimpleNamespace(bits=12)

    def check(mesh: Mesh) -> None:
        result: Any = SimpleNamespace(header=header, mesh=mesh)
        demo._check(result, "spot")

    check(exact)
    for wrong in (
        Mesh(moved, exact.faces),
        Mesh(exact.vertices, exact.faces[::-1]),
        Mesh(exact.vertices, exact.faces[1:]),
    ):
        with pytest.raises(MismatchError):
            check(wrong)


def test_files_that_are_there_are_left_alone(tmp_path: Path) -> None:
    for name, draw in (("spot-level-3.ply", False), ("levels.png", True)):
        (tmp_path / name).write_text("mine")
        with pytest.raises(OptionError, match=f"{name} is there already"):
            run_demo(tmp_path, "spot", draw=draw, overwrite=False)
        assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, "mine")]
        (tmp_path / name).unlink()
    (tmp_path / "file").touch()
    with pytest.raises(OptionError, match="is a file; name a folder"):
        run_demo(tmp_path / "file", "spot")


def test_an_unknown_sample_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="there is no sample 'teapot'"):
        run_demo(tmp_path / "new", "teapot")
    assert not (tmp_path / "new").exists()
