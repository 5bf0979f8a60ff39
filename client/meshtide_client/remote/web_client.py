"""Asking a meshtide server over HTTP: what every request has in common, and answers of bounded size.

An answer that was compressed on the way is expanded here, in pieces, and its length is bounded after that.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import httpx

from meshtide_client.connection.content_coding import ACCEPTED, read_body
from meshtide_client.connection.credentials import authorization
from meshtide_client.connection.problem import read_problem
from meshtide_client.connection.secrecy import without_secrets
from meshtide_client.connection.tls import distrust, tls_context
from meshtide_codec.errors import ProtocolError, TransferError

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_client.connection.address import ServerAddress

LARGEST_ANSWER = 1 << 26


@dataclass(frozen=True, slots=True)
class Answer:
    """What a server said.

    Args:
        status: of HTTP.
        headers: of the answer, any case.
        body: expanded.
        links: what the header Link names.
    """

    status: int
    headers: httpx.Headers
    body: bytes
    links: dict[str | None, dict[str, str]]

    def value(self) -> Any:  # noqa: ANN401 - anything may come
        """The JSON in the body.

        Raises:
            ValueError: there is none.
        """
        try:
            return json.loads(self.body)
        except RecursionError as error:
            raise ValueError("the JSON is nested too deep") from error


class WebClient:
    """A connection to one server; a context manager, which several threads may use.

    Args:
        server: where it is.
        timeout: seconds without any news.
        token: to be shown, or None.
        ca_file: of the authorities that vouch for it; see `tls_context`.

    Raises:
        OptionError: `ca_file` cannot be used.
    """

    def __init__(
        self, server: ServerAddress, *, timeout: float, token: str | None, ca_file: Path | str | None = None
    ) -> None:
        self._server = server
        self._timeout = timeout
        self._client = httpx.Client(
            timeout=timeout,
            trust_env=not server.is_loopback,
            verify=tls_context(ca_file, needed=server.secure),
            headers={"Accept-Encoding": ACCEPTED, **authorization(token)},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def ask(self, method: str, url: str, *, largest: int = LARGEST_ANSWER, **more: Any) -> Answer:  # noqa: ANN401
        """The answer to one request; `more` goes to httpx. Only reading follows redirects.

        Raises:
            TransferError: there is no connection, or it was lost.
            ProtocolError: what answers is no such server, or says more than `largest` bytes.
        """
        try:
            with self._client.stream(method, url, follow_redirects=method == "GET", **more) as response:
                if self._server.secure and response.url.scheme != "https":
                    raise ProtocolError(f"{self._server} redirects to an address without TLS; that is not followed")
                coding = response.headers.get("Content-Encoding", "")
                body = read_body(response.iter_raw(), coding, str(self._server), largest)
                return Answer(response.status_code, response.headers, body, response.links)
        except httpx.TimeoutException as error:
            raise TransferError(f"{self._server} did not answer within {self._timeout:g} seconds") from error
        except httpx.RemoteProtocolError as error:
            reason = without_secrets(str(error))
            raise ProtocolError(f"what answers at {self._server} is not a meshtide server ({reason})") from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            reason = distrust(error) or without_secrets(str(error))
            raise TransferError(f"cannot reach {self._server}: {reason}") from error


def refusal(answer: Answer, place: str) -> ProtocolError:
    """What an answer of another status than was hoped for means."""
    return read_problem(answer.body) or ProtocolError(
        f"{place} answered with HTTP status {answer.status}; check the address"
    )
