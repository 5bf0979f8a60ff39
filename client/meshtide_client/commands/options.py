"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TimeoutOption = Annotated[float, typer.Option(help="Seconds without any news until the connection counts as lost.")]
TokenFileOption = Annotated[
    Path | None, typer.Option(help="File that holds the token for the server; without it, MESHTIDE_TOKEN is the token.")
]
CaFileOption = Annotated[
    Path | None,
    typer.Option(
        "--ca-file",
        help="File of the authorities (PEM) that vouch for the server, in place of this machine's; "
        "without it, SSL_CERT_FILE or SSL_CERT_DIR names them.",
    ),
]
