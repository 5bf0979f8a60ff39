"""The HTTP protocol of uvicorn, with its connection told to the application, which can then cut one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.auto import AutoHTTPProtocol

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Mapping

_Base: Any = AutoHTTPProtocol
"""Which of uvicorn's protocols it is depends on what is installed."""


class CuttableProtocol(_Base):  # type: ignore[misc] # see above
    """`scope["state"]["transport"]` is the connection of a request, and of a websocket that begins as one."""

    app_state: dict[str, Any]

    def connection_made(self, transport: asyncio.Transport) -> None:
        """Called by the event loop."""
        self.app_state = {**self.app_state, "transport": transport}
        super().connection_made(transport)


def cut(scope: Mapping[str, Any]) -> None:
    """End the connection of a client that does not read: what waits to be sent is dropped, a farewell as well."""
    transport = scope.get("state", {}).get("transport")
    if transport is not None:
        transport.abort()
