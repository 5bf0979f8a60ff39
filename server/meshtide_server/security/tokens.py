"""Bearer tokens: where they come from, and how one that a client shows is compared with them.

Tokens are given in an environment variable or in a file, one a line, several at a time, so that a new one can be
handed out before an old one is withdrawn. They are kept as digests under a key of this process, and compared in a time
that does not depend on where two of them differ.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from typing import TYPE_CHECKING

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from pydantic import SecretStr

SHORTEST_TOKEN = 16
"""Characters; `python -c "import secrets; print(secrets.token_urlsafe())"` makes 43."""
LONGEST_TOKEN = 512
LARGEST_FILE = 1 << 16
_TOKEN = re.compile(r"[A-Za-z0-9._~+/=-]+")


class TokenSet:
    """Tokens of which a client has to show one.

    Args:
        tokens: the secrets; none means that nobody can show one.

    >>> tokens = TokenSet(["a-secret-of-someone", "a-secret-of-others"])
    >>> "a-secret-of-others" in tokens, "guess" in tokens, tokens
    (True, False, TokenSet(2 tokens))
    """

    def __init__(self, tokens: Iterable[str]) -> None:
        self._key = secrets.token_bytes(32)
        self._digests = tuple(self._digest(token) for token in tokens)

    def __bool__(self) -> bool:
        return bool(self._digests)

    def __contains__(self, token: str) -> bool:
        digest = self._digest(token)
        found = False
        for known in self._digests:  # all of them, so that the time does not reveal which one it was
            found |= hmac.compare_digest(known, digest)
        return found

    def __repr__(self) -> str:
        return f"TokenSet({len(self._digests)} tokens)"

    def _digest(self, token: str) -> bytes:
        return hmac.digest(self._key, token.encode(errors="surrogatepass"), hashlib.sha256)


def collect_tokens(given: Iterable[SecretStr], file: Path | None, purpose: str) -> Sequence[str]:
    """All tokens for `purpose` ("write" or "read"), of the settings and of the file; each one once.

    Args:
        given: those of the environment.
        file: a file of tokens, one a line; empty lines and lines that start with # are skipped.
        purpose: for messages.

    Raises:
        OptionError: a token that no header can carry or that is too short to be a secret, or a file that cannot be
            read. No message repeats a token.
    """
    variable = f"MESHTIDE_{purpose.upper()}_TOKENS"
    places = [(token.get_secret_value(), f"{variable}, token {n}") for n, token in enumerate(given, start=1)]
    if file is not None:
        places += [(line, f"{file}, line {n}") for n, line in _lines(file)]
        if not places:
            raise OptionError(f"{file} holds no token; write one a line, or leave the setting out")
    for token, place in places:
        problem = token_problem(token)
        if problem:
            raise OptionError(f"{place}: {problem}")
    return tuple(dict.fromkeys(token for token, _ in places))


def token_problem(token: str) -> str | None:
    """What is wrong with `token`, in words that do not repeat it; None if nothing is."""
    if not SHORTEST_TOKEN <= len(token) <= LONGEST_TOKEN:
        return f"a token has {SHORTEST_TOKEN} to {LONGEST_TOKEN} characters, this one has {len(token)}"
    if not _TOKEN.fullmatch(token):
        return "a token consists of letters, digits and -._~+/= only"
    return None


def _lines(file: Path) -> list[tuple[int, str]]:
    try:
        with file.open("rb") as opened:
            data = opened.read(LARGEST_FILE + 1)
    except OSError as error:
        raise OptionError(f"the tokens in {file} cannot be read: {error.strerror or error}") from error
    if len(data) > LARGEST_FILE:
        raise OptionError(f"{file} has more than {LARGEST_FILE} bytes; it should hold tokens, one a line")
    lines = [line.strip() for line in data.decode(errors="replace").splitlines()]
    return [(number, line) for number, line in enumerate(lines, start=1) if line and not line.startswith("#")]
