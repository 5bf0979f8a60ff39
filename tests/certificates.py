"""An authority of the tests' own, which no machine trusts, and a server's certificate from it."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from typing import TYPE_CHECKING

import trustme

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Authority:
    """Its certificate in PEM, and what a server on this machine speaks TLS with."""

    file: Path
    server: ssl.SSLContext


def private_authority(folder: Path) -> Authority:
    """A new authority whose certificate lies in `folder`."""
    made = trustme.CA()
    file = folder / "authority.pem"
    made.cert_pem.write_to_path(str(file))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.issue_cert("127.0.0.1", "localhost").configure_cert(context)
    return Authority(file, context)
