"""Options of every command that talks to a server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

CaFileOption = Annotated[
    Path | None,
    typer.Option(
        "--ca-file",
        help="File of the authorities (PEM) that vouch for the server, in place of this machine's; "
        "without it, SSL_CERT_FILE or SSL_CERT_DIR names them.",
    ),
]
