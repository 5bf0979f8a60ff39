from __future__ import annotations

import os
import signal
import sys
import time
from typing import TYPE_CHECKING

import pytest

from meshtide_client.commands import server_process
from meshtide_client.commands.server_process import running_server
from meshtide_codec.errors import TransferError

if TYPE_CHECKING:
    from pathlib import Path

ANNOUNCE = 'print(\'{"url": "http://here"}\', flush=True)'


def pretend(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Let another program stand for the server."""
    monkeypatch.setattr(server_process, "_COMMAND", (sys.executable, "-c", code))


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def waiting(path: Path) -> str:
    tell = f"pathlib.Path({str(path)!r}).write_text(str(os.getpid()))"
    return f"import os, pathlib, time; {tell}; {ANNOUNCE}; time.sleep(60)"


def test_the_url_is_yielded_and_the_process_stopped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pretend(monkeypatch, waiting(tmp_path / "pid"))
    with running_server() as url:
        assert url == "http://here"
        pid = int((tmp_path / "pid").read_text())
        assert alive(pid)
    assert not alive(pid)


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_the_process_is_stopped_when_the_block_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, error: type[BaseException]
) -> None:
    pretend(monkeypatch, waiting(tmp_path / "pid"))
    with pytest.raises(error), running_server():
        raise error
    assert not alive(int((tmp_path / "pid").read_text()))


def test_the_process_is_stopped_on_sigterm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pretend(monkeypatch, waiting(tmp_path / "pid"))
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as caught, running_server():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5)
    assert caught.value.code == 128 + signal.SIGTERM
    assert not alive(int((tmp_path / "pid").read_text()))
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_process_that_does_not_listen_to_reason_is_killed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pretend(monkeypatch, f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {waiting(tmp_path / 'pid')}")
    monkeypatch.setattr(server_process, "_STOP_SECONDS", 0.2)
    with running_server():
        pass
    assert not alive(int((tmp_path / "pid").read_text()))


def test_what_a_server_says_that_does_not_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, "import sys; sys.exit('the port is taken')")
    with pytest.raises(TransferError, match="the server did not start; it said: the port is taken"), running_server():
        pass


@pytest.mark.parametrize("line", ["hello", "[]", "{}", ""])
def test_a_foreign_announcement_is_told(monkeypatch: pytest.MonkeyPatch, line: str) -> None:
    pretend(monkeypatch, f"print({line!r}, flush=True)")
    with pytest.raises(TransferError, match="did not start; it said nothing"), running_server():
        pass


def test_a_server_that_says_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, "import time; time.sleep(60)")
    with pytest.raises(TransferError, match=r"did not start within 0\.3 seconds"), running_server(wait=0.3):
        pass
