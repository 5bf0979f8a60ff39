"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TimeoutOption = Annotated[float, typer.Option(help="Seconds without data after which the connection counts as lost.")]
TokenFileOption = Annotated[
    Path | None, typer.Option(help="File that holds the server's token; by default MESHTIDE_TOKEN is the token.")
]
CaFileOption = Annotated[
    Path | None,
    typer.Option(
        "--ca-file",
        help="PEM file of the certificate authorities to trust, in place of this machine's; by default what "
        "SSL_CERT_FILE or SSL_CERT_DIR names.",
    ),
]
