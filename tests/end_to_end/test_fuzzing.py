"""The fuzzers of tests/bench/load against a real server process, with fewer requests."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "bench" / "load"


@pytest.mark.parametrize(
    ("program", "option", "counted", "wanted"),
    [("fuzz_http.py", "--requests", "requests", 600), ("fuzz_websocket.py", "--messages", "messages", 300)],
)
def test_a_server_takes_whatever_comes(program: str, option: str, counted: str, wanted: int) -> None:
    if program == "fuzz_http.py":
        pytest.importorskip("schemathesis")
    done = subprocess.run(
        [sys.executable, FOLDER / program, option, str(wanted), "--seconds", "120", "--seed", "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout)
    assert result["problems"] == []
    assert result[counted] >= wanted
