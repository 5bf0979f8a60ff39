"""Who may read and who may write.

Writing takes a write token. Reading takes a read token or a write token if any read token is configured, and nothing
otherwise. A token comes as `Authorization: Bearer TOKEN`; a websocket may show a one-time ticket instead, as
`?ticket=...`.
"""

from __future__ import annotations

import time
from http import HTTPStatus
from typing import TYPE_CHECKING

from meshtide_server.refusals import RefusedError
from meshtide_server.security.tickets import TicketOffice
from meshtide_server.security.tokens import TokenSet, collect_tokens

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_server.settings import Settings


class Access:
    """The tokens and tickets of one server.

    Args:
        settings: the tokens, and how long tickets are good.
        clock: seconds since 1970.

    Raises:
        OptionError: a token or a file of tokens that cannot be used.
    """

    def __init__(self, settings: Settings, clock: Callable[[], float] = time.time) -> None:
        read = collect_tokens(settings.read_tokens, settings.read_tokens_file, "read")
        self._writers = TokenSet(collect_tokens(settings.write_tokens, settings.write_tokens_file, "write"))
        self._readers = TokenSet(read)
        self._tickets = TicketOffice(read, seconds=settings.ticket_seconds, clock=clock)

    @property
    def writable(self) -> bool:
        """Whether there is a token for writing."""
        return bool(self._writers)

    @property
    def readable_by_all(self) -> bool:
        """Whether reading takes no token."""
        return not self._readers

    def check_read(self, token: str | None) -> None:
        """Let pass who may read.

        Args:
            token: what the client has shown, or None.

        Raises:
            RefusedError: 401.
        """
        if self.readable_by_all or (token is not None and (token in self._readers) | (token in self._writers)):
            return
        raise _unauthorized("reading takes a token", shown=token is not None)

    def check_write(self, token: str | None) -> None:
        """Let pass who may write.

        Args:
            token: what the client has shown, or None.

        Raises:
            RefusedError: 401, or 403 if nobody may write or the token is for reading.
        """
        if not self.writable:
            message = "this server takes no uploads and no changes: it has no write token (MESHTIDE_WRITE_TOKENS)"
            raise RefusedError(HTTPStatus.FORBIDDEN, "read-only", message)
        if token is None or token not in self._writers:
            if token is not None and token in self._readers:
                raise RefusedError(
                    HTTPStatus.FORBIDDEN, "read-only", "this token is for reading; writing takes another"
                )
            raise _unauthorized("writing takes a token", shown=token is not None)

    def check_stream(self, authorization: str | None, ticket: str | None) -> None:
        """Let pass who may open a stream: a reader, or who shows a ticket, which is used up by that.

        Args:
            authorization: the handshake's header of that name, or None.
            ticket: from the address, or None.

        Raises:
            RefusedError: 401.
        """
        if ticket is not None and not self.readable_by_all:
            if self._tickets.take(ticket):
                return
            message = "the ticket is not good, was used before or is too old; POST /tickets gives another"
            raise RefusedError(HTTPStatus.UNAUTHORIZED, "bad-ticket", message)
        self.check_read(bearer_token(authorization))

    def issue_ticket(self) -> str:
        """A ticket that opens one stream."""
        return self._tickets.issue()


def bearer_token(authorization: str | None) -> str | None:
    """The token of an Authorization header, or None.

    >>> bearer_token("bearer  abc"), bearer_token("Basic abc"), bearer_token(None)
    ('abc', None, None)
    """
    scheme, _, token = (authorization or "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" and token.strip() else None


def _unauthorized(what: str, *, shown: bool) -> RefusedError:
    reason = "the one that was sent is not known" if shown else "none was sent"
    message = f"{what}, and {reason}; send it as Authorization: Bearer TOKEN (meshtide: MESHTIDE_TOKEN)"
    return RefusedError(HTTPStatus.UNAUTHORIZED, "unauthorized", message)
