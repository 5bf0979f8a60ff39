"""What the fuzzers of files share: a child process that reads one damaged file after the other, watched from outside.

The child is held to an amount of memory and reports each file's number before it reads it, so whatever ends it or keeps
it busy is laid at the door of one file, which is made again from its number alone.
"""

from __future__ import annotations

import argparse
import json
import random
import select
import subprocess
import sys
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

CHILD_MEMORY = 1 << 31
"""Bytes of data that the child may have: some twenty times what its libraries take."""
LONGEST_SECONDS = 20.0
"""A file of a few kilobytes that takes longer is a problem."""
MOST_PROBLEMS = 20


def run(
    about: str | None,
    attempt: Callable[[random.Random], str],
    foreseen: tuple[type[BaseException], ...],
    arguments: Sequence[str] | None = None,
) -> int:
    """A fuzzer's command; returns the exit code: 0 if nothing was found.

    Args:
        about: the help text.
        attempt: makes one damaged file, reads it, returns a word for what happened.
        foreseen: the errors that reading may end in.
        arguments: of the command line.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=10**9, help="how many at most (default: as many as there is time)")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is random (default: %(default)s)")
    parser.add_argument("--one", type=int, help="read the file of this number only, here, and show what it does")
    parser.add_argument("--child-from", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.one is not None:
        print(attempt(_chance(given.seed, given.one)))
        return 0
    if given.child_from is not None:
        _child(attempt, foreseen, given.seed, given.child_from)
        return 0
    result = _watch(given.files, given.seconds, given.seed)
    print(json.dumps(result, indent=1))
    return 1 if result["problems"] else 0


def _chance(seed: int, number: int) -> random.Random:
    return random.Random(f"{seed}/{number}")


def _child(
    attempt: Callable[[random.Random], str], foreseen: tuple[type[BaseException], ...], seed: int, number: int
) -> None:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (CHILD_MEMORY, CHILD_MEMORY))
    while True:
        print(json.dumps({"begin": number}), flush=True)
        try:
            word = attempt(_chance(seed, number))
        except foreseen as error:
            word = type(error).__name__
        except BaseException:  # noqa: BLE001 - whatever it is, it is a finding
            print(json.dumps({"problem": f"file {number}: {traceback.format_exc()[-1500:]}"}), flush=True)
            word = "problem"
        print(json.dumps({"end": word}), flush=True)
        number += 1


@dataclass
class _Findings:
    """What is known so far.

    Args:
        number: of the file that is being read.
        done: how many were.
        ends: how often reading ended in what.
        problems: a fault each, told once.
    """

    number: int = 0
    done: int = 0
    ends: dict[str, int] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    places: set[str] = field(default_factory=set)

    def take(self, event: dict[str, Any]) -> None:
        """A line of the child."""
        if "begin" in event:
            self.number = event["begin"]
        elif "problem" in event:
            place = event["problem"].rpartition("\n  File")[2]
            if place not in self.places:
                self.problems.append(event["problem"])
                self.places.add(place)
        else:
            self.done += 1
            self.ends[event["end"]] = self.ends.get(event["end"], 0) + 1

    def blame(self, what: str) -> None:
        """Lay what happened to the child at the door of the file that it read, and go on with the next one."""
        self.problems.append(f"file {self.number} {what}")
        self.number += 1


def _watch(wanted: int, seconds: float, seed: int) -> dict[str, Any]:
    started = time.monotonic()
    found = _Findings()

    def enough() -> bool:
        late = time.monotonic() > started + seconds
        return late or found.done >= wanted or len(found.problems) >= MOST_PROBLEMS

    while not enough():
        program = str(Path(sys.argv[0]).resolve())
        command = [sys.executable, program, "--seed", str(seed), "--child-from", str(found.number)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, bufsize=0) as child:
            _follow(child, found, enough)
            child.kill()
    if not found.done:
        found.problems.append("no file was read")
    taken = round(time.monotonic() - started, 1)
    return {"files": found.done, "seconds": taken, "ends": dict(sorted(found.ends.items())), "problems": found.problems}


def _follow(child: subprocess.Popen[bytes], found: _Findings, enough: Callable[[], bool]) -> None:
    """Take what a child reports until it ends, hangs, or there is enough."""
    assert child.stdout is not None
    pending = b""
    shown = time.monotonic()
    while not enough():
        if not select.select([child.stdout], [], [], LONGEST_SECONDS)[0]:
            found.blame(f"keeps the reader busy for more than {LONGEST_SECONDS:g} s")
            return
        piece = child.stdout.read(65536)
        if not piece:
            found.blame(f"ended the process with code {child.wait()}")
            return
        *lines, pending = (pending + piece).split(b"\n")
        for line in lines:
            found.take(json.loads(line))
        if time.monotonic() > shown + 10:
            shown = time.monotonic()
            print(f"{found.done} files, {len(found.problems)} problems", file=sys.stderr)
