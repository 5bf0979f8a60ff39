from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from meshtide_codec.termination import ENDING_SIGNALS, Terminated, terminable

POOL = """
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from meshtide_codec.termination import terminable

if __name__ == "__main__":
    with terminable(), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        waiting = pool.submit(time.sleep, 600)
        while not waiting.running():
            time.sleep(0.01)
        print("working", flush=True)
        waiting.result()
"""


@pytest.mark.parametrize("number", ENDING_SIGNALS, ids=lambda number: number.name)
def test_a_signal_leaves_blocks_in_order(number: signal.Signals) -> None:
    left = []
    with pytest.raises(Terminated) as ending, terminable():
        try:
            os.kill(os.getpid(), number)
            time.sleep(5)
        finally:
            left.append(signal.getsignal(number))
    assert ending.value.code == 128 + number
    assert left == [signal.SIG_DFL]  # a second signal would end the process at once


def test_who_listens_already_goes_on() -> None:
    def handler(_number: int, _frame: object) -> None:
        """Stand for the handler of a server."""

    earlier = signal.signal(signal.SIGTERM, handler)
    try:
        with terminable():
            assert signal.getsignal(signal.SIGTERM) is handler
        assert signal.getsignal(signal.SIGTERM) is handler
    finally:
        signal.signal(signal.SIGTERM, earlier)


def test_other_threads_change_nothing() -> None:
    seen = []

    def look() -> None:
        with terminable():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGTERM)]


def test_a_pool_of_processes_is_not_waited_for(tmp_path: Path) -> None:
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "working\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 143
