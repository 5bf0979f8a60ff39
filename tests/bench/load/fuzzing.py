"""What the fuzzers share: how long they go on, what they report, and their commands."""

from __future__ import annotations

import argparse
import json
import random
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from watched_server import WatchedServer

MOST_PROBLEMS = 20


@dataclass
class Budget:
    """How much is sent, and for how long.

    Args:
        server: that it is sent to.
        wanted: how many messages or requests; 0 for as many as there is time for.
        seconds: how long at most.
        seed: of everything that is random.
    """

    server: WatchedServer
    wanted: int
    seconds: float
    seed: int
    sent: int = 0
    started: float = field(default_factory=time.monotonic)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)

    @property
    def done(self) -> bool:
        """Whether there was enough of messages, or of time if no number was asked for, or of problems."""
        too_late = time.monotonic() > self.started + self.seconds
        enough = self.sent >= self.wanted > 0
        return enough or too_late or len(self.server.problems) > MOST_PROBLEMS

    @property
    def warm(self) -> bool:
        """Whether a quarter is done: the server has grown to its working size."""
        late = time.monotonic() > self.started + self.seconds / 4
        return self.sent >= self.wanted // 4 if self.wanted else late

    def report(self, counted: str, **details: Any) -> dict[str, Any]:
        """What was sent and seen, how the server has grown, and what was wrong, which is nothing if all is well.

        Args:
            counted: what was sent.
            details: more to tell.
        """
        seconds = round(time.monotonic() - self.started, 1)
        growth = self.server.growth()
        if self.sent < self.wanted:
            self.server.problems.append(f"only {self.sent} of {self.wanted} {counted} were sent in {self.seconds:g} s")
        return {counted: self.sent, "seconds": seconds, **details, **growth, "problems": self.server.problems}


def run_command(
    about: str | None,
    counted: str,
    fuzz: Callable[[int, float, int], dict[str, Any]],
    arguments: Sequence[str] | None = None,
) -> int:
    """A fuzzer's command; returns the exit code.

    Args:
        about: the help text.
        counted: what is sent; the option that tells how much is named so.
        fuzz: sends so many, for so many seconds at most, with a seed; returns what was seen.
        arguments: of the command line.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        f"--{counted}", type=int, default=10_000, help="how many; 0: until the time is over (default: %(default)s)"
    )
    parser.add_argument("--seconds", type=float, default=900.0, help="how long at most (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is random (default: %(default)s)")
    given = parser.parse_args(arguments)
    result = fuzz(getattr(given, counted), given.seconds, given.seed)
    print(json.dumps(result, indent=1))
    return 1 if result["problems"] else 0
