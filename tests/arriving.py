"""What a transport, or attempts over several, bring, one event after the other."""

from __future__ import annotations

from contextlib import aclosing
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator

    from meshtide_codec.stream.session import Event


class Arriving(Protocol):
    async def next_events(self) -> list[Event] | None: ...

    async def aclose(self) -> None: ...


async def events_of(arriving: Arriving) -> AsyncGenerator[Event, None]:
    """All its events; it is closed at the end, also when the loop is left early and this generator closed."""
    async with aclosing(arriving):
        while (events := await arriving.next_events()) is not None:
            for event in events:
                yield event
