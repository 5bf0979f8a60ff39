"""Answers that are ready to be sent: the whole HTTP answer of what is asked for most, packets and small files.

Finding out what to answer costs a hundred times what sending a packet does. An answer that a route has given, and
marked with how to see that it still holds, is kept as bytes and given again for a short while by the protocol, before
the application is even asked. Requests whose headers could change the answer always go to the application.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from meshtide_server.settings import Settings

LARGEST_BODY = 60 * 1024
"""With its headers it fits into what a connection may hold back, 64 KiB, so that nobody has to wait for a reader."""
BUDGET = 32 << 20
"""Bytes of bodies that are kept."""
SECONDS = 1.0
"""How long an answer may be given again: another server may have deleted the mesh meanwhile."""
_DECISIVE = frozenset({
    b"authorization", b"content-length", b"expect", b"origin", b"range", b"te", b"transfer-encoding", b"upgrade",
})  # fmt: skip
"""Headers that may change the answer, or ask for more than one; so do all that begin with if-."""


@dataclass(frozen=True, slots=True)
class PreparedAnswer:
    """An answer as it is sent.

    Args:
        head: status line and headers, without the empty line that ends them.
        body: all of it.
        route: template of the route that made it, for the metrics.
        holds: tells, without waiting, whether it would still be given.
        until: when it has to be made anew, in seconds of the clock.
    """

    head: bytes
    body: bytes
    route: str
    holds: Callable[[], bool]
    until: float


class PreparedAnswers:
    """The answers that are ready; those that were not asked for the longest give way.

    Args:
        enabled: whether there are any at all.
        budget: bytes of bodies that are kept.
        clock: seconds, never going back.
    """

    def __init__(
        self, *, enabled: bool = True, budget: int = BUDGET, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.enabled = enabled
        self._budget = budget
        self._clock = clock
        self._size = 0
        self._answers: OrderedDict[bytes, PreparedAnswer] = OrderedDict()

    def __len__(self) -> int:
        return len(self._answers)

    def find(self, target: bytes, headers: Iterable[tuple[bytes, bytes]]) -> PreparedAnswer | None:
        """The answer to a GET request, or None if the application has to be asked.

        Args:
            target: path of the request, with its query.
            headers: of the request, names in lower case.
        """
        answer = self._answers.get(target)
        if answer is None or not plain(headers):
            return None
        if self._clock() >= answer.until or not answer.holds():
            self._drop(target)
            return None
        self._answers.move_to_end(target)
        return answer

    def keep(
        self,
        target: bytes,
        headers: Iterable[tuple[bytes, bytes]],
        body: bytes,
        route: str,
        holds: Callable[[], bool],
    ) -> None:
        """Keep an answer with status 200.

        Args:
            target: path of the request, which had no query and no decisive header.
            headers: of the answer; neither Date nor the request's id.
            body: of the answer, at most LARGEST_BODY bytes.
            route: template of the route that made it.
            holds: tells, without waiting, whether it would still be given.
        """
        self._drop(target)
        head = b"HTTP/1.1 200 OK\r\n" + b"".join(name + b": " + value + b"\r\n" for name, value in headers)
        self._answers[target] = PreparedAnswer(head, body, route, holds, self._clock() + SECONDS)
        self._size += len(body)
        while self._size > self._budget:
            self._drop(next(iter(self._answers)))

    def clear(self) -> None:
        """Forget all: something was changed."""
        self._answers.clear()
        self._size = 0

    def _drop(self, target: bytes) -> None:
        answer = self._answers.pop(target, None)
        if answer is not None:
            self._size -= len(answer.body)


def prepared_answers(settings: Settings) -> PreparedAnswers:
    """What fits `settings`: none where each request has to be looked at, for a token, a limit or a line in the log."""
    looked_at = bool(settings.read_tokens or settings.read_tokens_file or settings.bytes_per_second)
    return PreparedAnswers(enabled=not (looked_at or settings.access_log or settings.log_level == "debug"))


def plain(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Whether none of a request's headers could change the answer.

    >>> plain([(b"host", b"localhost"), (b"connection", b"keep-alive")])
    True
    >>> plain([(b"host", b"localhost"), (b"if-none-match", b"*")])
    False
    """
    for name, value in headers:
        if name in _DECISIVE or name.startswith(b"if-") or (name == b"connection" and value.lower() != b"keep-alive"):
            return False
    return True
