"""The refusal of a request: one exception for all of them, whichever room finds the reason."""

from __future__ import annotations

from http import HTTPStatus

from meshtide_codec.errors import MeshtideError


class RefusedError(MeshtideError):
    """A request that cannot be met.

    Args:
        status: of the HTTP answer.
        code: for programs.
        message: for people.
        retry_after: seconds after which it may go better.
    """

    def __init__(self, status: HTTPStatus, code: str, message: str, *, retry_after: int | None = None) -> None:
        self.status = status
        self.code = code
        self.message = message
        self.retry_after = retry_after
        super().__init__(message)

    @property
    def headers(self) -> dict[str, str]:
        """Headers of the HTTP answer."""
        headers = {} if self.retry_after is None else {"Retry-After": str(self.retry_after)}
        if self.status == HTTPStatus.UNAUTHORIZED:
            headers["WWW-Authenticate"] = 'Bearer realm="meshtide"'
        if self.status == HTTPStatus.REQUEST_TIMEOUT:
            headers["Connection"] = "close"  # the rest of the request is not waited for
        return headers
