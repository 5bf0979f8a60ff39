"""The table of load figures: python tests/bench/load/all.py [--reach]; takes about five minutes.

Runs the programs beside it one after the other and prints their rows as one Markdown table. With --reach, the number of
clients is the larger one of 5000 idle and 1000 streaming. Ends with exit code 1 if a bound does not hold.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
BOUND_SECONDS = 300
PROGRAMS = (
    ("concurrent_streams.py", "--clients", "500"),
    ("http_throughput.py", "--what", "packets"),
    ("http_throughput.py", "--what", "file"),
    ("websocket_throughput.py",),
    ("idle_memory.py",),
    ("first_packet.py",),
    ("killed_server.py",),
    ("large_catalogue.py",),
    ("store_throughput.py",),
)
REACH = ("concurrent_streams.py", "--clients", "1000", "--idle", "5000")


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reach", action="store_true")
    arguments = parser.parse_args()
    failed = 0
    print("| what | measured | must | holds | details |\n|---|---|---|---|---|", flush=True)
    for name, *options in (*PROGRAMS, *([REACH] if arguments.reach else [])):
        command = [sys.executable, str(FOLDER / name), *options]
        done = subprocess.run(command, capture_output=True, text=True, timeout=BOUND_SECONDS, check=False)
        failed += done.returncode != 0
        rows = [line for line in done.stdout.splitlines() if line.startswith("| ")]
        print(*(rows or [f"| {name} | not measured | | NO | {done.stderr.strip()[-300:]} |"]), sep="\n", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
