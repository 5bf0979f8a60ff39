"""How a client treats its connections: patience, retries, rate, token, and whom it trusts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from meshtide_client.connection.credentials import find_token
from meshtide_codec.errors import OptionError
from meshtide_codec.stream.session import DEFAULT_WINDOW

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True)
class Link:
    """How a client treats its connection.

    Args:
        timeout: seconds without any part of a message after which the connection is taken for lost, and for opening it.
        retries: how often a lost connection is opened again before giving up; packets that arrive reset the count.
        delay: seconds before the first retry; each further one waits twice as long.
        longest_delay: bound of that.
        window: bytes in flight that the server is allowed.
        rate: bytes a second at which frames are taken, to see a slow link on a fast one; None for no bound.
        token: what is shown to a meshtide server that asks for one; that of the environment when left out.
        ca_file: of the authorities that vouch for servers; those of the environment or the machine when left out.

    Raises:
        OptionError: a value that makes no sense.
    """

    timeout: float = 30.0
    retries: int = 5
    delay: float = 0.5
    longest_delay: float = 10.0
    window: int = DEFAULT_WINDOW
    rate: float | None = None
    token: str | None = field(default_factory=find_token, repr=False)
    ca_file: Path | str | None = None

    def __post_init__(self) -> None:
        for name in ("timeout", "delay", "longest_delay", "window"):
            if not getattr(self, name) > 0:
                raise OptionError(f"the {name.replace('_', ' ')} of a link must be positive, not {getattr(self, name)}")
        if self.retries < 0:
            raise OptionError(f"the retries of a link must not be negative: {self.retries}")
        if self.rate is not None and not self.rate > 0:
            raise OptionError(f"the rate of a link must be positive, not {self.rate}")

    def without_token(self) -> Link:
        """The same, for a server that is none of meshtide's."""
        return replace(self, token=None)
