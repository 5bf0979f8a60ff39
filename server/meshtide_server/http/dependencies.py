"""What the routes depend on: who may read, and who may write."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.models import Problem

READ_SCHEME = HTTPBearer(
    auto_error=False, scheme_name="read token", description="Needed where the server has read tokens; else left out."
)
_WRITE_SCHEME = HTTPBearer(auto_error=False, scheme_name="write token", description="One of the server's write tokens.")
UNAUTHORIZED: dict[int | str, dict[str, Any]] = {
    401: {"model": Problem, "description": "The server has read tokens, and none of them was sent."}
}


async def require_read(
    server: Running, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(READ_SCHEME)]
) -> None:
    """A dependency of routes that read.

    Raises:
        RefusedError: 401.
    """
    server.access.check_read(credentials.credentials if credentials else None)


async def require_write(
    server: Running, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_WRITE_SCHEME)]
) -> None:
    """A dependency of routes that write.

    Raises:
        RefusedError: 401 or 403.
    """
    server.access.check_write(credentials.credentials if credentials else None)


READERS = [Depends(require_read)]
