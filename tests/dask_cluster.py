"""A Dask cluster on this machine for the tests: a scheduler and worker processes, in a process of their own.

    python tests/dask_cluster.py 2

prints the scheduler's address and the workers' process ids as one line of JSON, and runs until its input ends.
"""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

STOP_SECONDS = 20


@dataclass(frozen=True)
class RunningCluster:
    """Where it is, and the processes of its workers."""

    address: str
    workers: tuple[int, ...]
    process: subprocess.Popen[bytes]

    def stop(self) -> None:
        """Kill the scheduler; its workers follow."""
        self.process.kill()
        self.process.wait(STOP_SECONDS)


@contextmanager
def running_cluster(workers: int, folder: Path) -> Iterator[RunningCluster]:
    """A cluster of so many workers of one thread each, which keep their files in `folder`."""
    command = [sys.executable, str(Path(__file__).resolve()), str(workers)]
    with (
        (folder / "log").open("wb") as log,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, cwd=folder) as process,
    ):
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            assert line, (folder / "log").read_text()[-3000:]
            told = json.loads(line)
            yield RunningCluster(told["address"], tuple(told["workers"]), process)
        finally:
            process.stdin.close()
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()


def main() -> None:
    """Run a cluster until standard input ends."""
    from distributed import LocalCluster

    count = int(sys.argv[1])
    with LocalCluster(
        n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1", memory_limit=0
    ) as cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        print(json.dumps({"address": cluster.scheduler_address, "workers": pids}), flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
