"""The argument that names a stream, and what is read of the stream, with the file's name in every message."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from meshtide_codec.shared_options import named_path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.errors import StreamError
    from meshtide_codec.limits import Limits
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

StreamArgument = Annotated[
    Path, typer.Argument(help="A .tide file, whole or cut short; - reads standard input.", parser=named_path)
]


def read_stream(stream: Path, limits: Limits) -> tuple[StreamHeader, Sequence[Packet], StreamError | None]:
    """Header and whole packets of a stream's file, or of standard input where it is called ``-``.

    Returns:
        The same as `read_available`; the error names the file.

    Raises:
        StreamError: not even the header can be read; the message names the file.
        OSError: the file cannot be read.
    """
    import sys

    from meshtide_codec.errors import StreamError
    from meshtide_codec.output_files import STANDARD_OUTPUT
    from meshtide_codec.printable import shown
    from meshtide_codec.stream.container import read_available

    piped = str(stream) == STANDARD_OUTPUT
    name = "standard input" if piped else shown(stream)
    data = sys.stdin.buffer.read() if piped else stream.read_bytes()
    try:
        header, packets, problem = read_available(data, limits)
    except StreamError as error:
        raise error.within(name) from error
    return header, packets, None if problem is None else problem.within(name)
