"""The command against a server whose meshes take a token."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_codec.command_line import ExitCode

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

READ = "token-for-reading-0"
MESH = "patch"


@pytest.fixture(scope="module", name="guarded")
def _guarded(encoded: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a mesh that takes a token."""
    folder = tmp_path_factory.mktemp("guarded")
    (folder / f"{MESH}.tide").write_bytes(encoded.to_bytes())
    command = [sys.executable, "-m", "meshtide_server", str(folder), "--port", "0", "--announce"]
    environment = {**os.environ, "MESHTIDE_READ_TOKENS": READ}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as process:
        try:
            assert process.stdout is not None
            yield json.loads(process.stdout.readline())["url"]
        finally:
            process.terminate()


@pytest.mark.parametrize("transport", ["websocket", "http", "download"])
def test_every_transport_shows_the_token(
    guarded: str, meshtide: Any, encoded: Any, transport: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["fetch", f"{guarded}/meshes/{MESH}", "--transport", transport, "--stream-file", "s.tide", "--json"]
    refused = meshtide(*arguments)
    assert refused.returncode == ExitCode.NETWORK
    assert "reading takes a token, and none was sent" in refused.stderr
    monkeypatch.setenv("MESHTIDE_TOKEN", "wrong-" + READ)
    wrong = meshtide(*arguments)
    assert wrong.returncode == ExitCode.NETWORK
    assert "is not known" in wrong.stderr
    monkeypatch.setenv("MESHTIDE_TOKEN", READ)
    done = meshtide(*arguments)
    assert done.returncode == ExitCode.OK, done.stderr
    assert (meshtide.folder / "s.tide").read_bytes() == encoded.to_bytes()
    for run in (refused, wrong, done):
        assert READ not in run.stdout + run.stderr


def test_a_file_holds_the_token(guarded: str, meshtide: Any) -> None:
    file: Path = meshtide.folder / "token"
    file.write_text(READ)
    assert MESH in meshtide("meshes", guarded, "--token-file", file).stdout
    done = meshtide("export", guarded, "--static", "site", "--token-file", file)
    assert done.returncode == ExitCode.OK, done.stderr
    assert (meshtide.folder / "site" / "meshes" / f"{MESH}.tide").exists()
    missing = meshtide("meshes", guarded, "--token-file", "missing")
    assert missing.returncode == ExitCode.USAGE
    assert "cannot be read" in missing.stderr
