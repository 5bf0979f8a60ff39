"""The token that a client shows to a server: from the environment or a file, never from the command line."""

from __future__ import annotations

import os
import re
from pathlib import Path

from meshtide_codec.errors import OptionError

VARIABLE = "MESHTIDE_TOKEN"
FILE_VARIABLE = "MESHTIDE_TOKEN_FILE"
_LARGEST_FILE = 1 << 16
_TOKEN = re.compile(r"[A-Za-z0-9._~+/=-]{1,512}")


def find_token(file: Path | str | None = None) -> str | None:
    """The token to show, or None if there is none.

    Args:
        file: a file whose first line that is not empty and does not start with # is the token; without it,
            `MESHTIDE_TOKEN` is the token, or `MESHTIDE_TOKEN_FILE` names the file.

    Raises:
        OptionError: the file cannot be read, or what is found is not a token; the message does not repeat it.
    """
    if file is None:
        if token := os.environ.get(VARIABLE, "").strip():
            return _checked(token, VARIABLE)
        file = os.environ.get(FILE_VARIABLE) or None
    return None if file is None else _checked(_first_line(Path(file)), str(file))


def authorization(token: str | None) -> dict[str, str]:
    """The headers that show `token`.

    >>> authorization("abc"), authorization(None)
    ({'Authorization': 'Bearer abc'}, {})
    """
    return {} if token is None else {"Authorization": f"Bearer {token}"}


def _first_line(file: Path) -> str:
    try:
        with file.open("rb") as opened:
            lines = opened.read(_LARGEST_FILE).decode(errors="replace").splitlines()
    except OSError as error:
        raise OptionError(f"the token in {file} cannot be read: {error.strerror or error}") from error
    return next((line.strip() for line in lines if line.strip() and not line.startswith("#")), "")


def _checked(token: str, place: str) -> str:
    if not _TOKEN.fullmatch(token):
        raise OptionError(f"{place} holds no token: one consists of 1 to 512 letters, digits and -._~+/=")
    return token
