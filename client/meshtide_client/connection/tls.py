"""Whose certificates are trusted: those of the authorities in a file that is named, or those of this machine.

`--ca-file` comes first, then the environment as OpenSSL has it (SSL_CERT_FILE, a file, and SSL_CERT_DIR, a folder with
hashed names); each stands in place of the machine's own authorities and of Mozilla's list, which are trusted without
them. It is the same for HTTP, for websockets and for servers on this machine.
"""

from __future__ import annotations

import os
import ssl
from functools import cache
from pathlib import Path

import certifi

from meshtide_codec.errors import OptionError
from meshtide_codec.printable import shown

FILE_VARIABLE = "SSL_CERT_FILE"
FOLDER_VARIABLE = "SSL_CERT_DIR"
_ADVICE = "if you trust it, name the file of its authority with --ca-file or SSL_CERT_FILE"


def tls_context(ca_file: Path | str | None = None, *, needed: bool = True) -> ssl.SSLContext:
    """What verifies servers.

    Args:
        ca_file: a file of certificates in PEM, or None for those of the environment or the machine.
        needed: whether TLS is spoken for sure; if it is not, an environment that makes no sense is passed over.

    Raises:
        OptionError: the file cannot be read, or holds no certificates; the message says who named it.
    """
    if ca_file is not None:
        return _trusting(Path(ca_file), None, "--ca-file")
    file, folder = (os.environ.get(name) or None for name in (FILE_VARIABLE, FOLDER_VARIABLE))
    if file is not None or folder is not None:
        try:
            return _trusting(Path(file) if file else None, folder, FILE_VARIABLE if file else FOLDER_VARIABLE)
        except OptionError:
            if needed:
                raise
    return _machine_context()


def named_authorities(ca_file: Path | str | None = None) -> bytes | None:
    """The contents of the file that is named, for who does not take a context; None if there is none.

    Raises:
        OptionError: it cannot be used.
    """
    file = ca_file or os.environ.get(FILE_VARIABLE)
    if not file:
        return None
    tls_context(ca_file)
    return Path(file).read_bytes()


def distrust(error: BaseException) -> str | None:
    """What a person should know of a certificate that was refused, or None if `error` is about something else."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, ssl.SSLCertVerificationError):
        cause = cause.__cause__ or cause.__context__
    if cause is None:
        return None
    reason = getattr(cause, "verify_message", None) or str(cause)
    return f"its certificate is not trusted ({reason}); {_ADVICE}"


@cache
def _machine_context() -> ssl.SSLContext:
    """What trusts the authorities of this machine and Mozilla's; reading them takes a tenth of a second."""
    context = ssl.create_default_context()
    context.load_verify_locations(certifi.where())
    return context


def _trusting(file: Path | None, folder: str | None, name: str) -> ssl.SSLContext:
    place = file if file is not None else folder
    try:
        if file is None and not Path(str(folder)).is_dir():
            raise NotADirectoryError(0, "there is no such folder")
        return ssl.create_default_context(cafile=file, capath=folder)
    except ssl.SSLError as error:
        raise OptionError(f"{shown(place)}, named by {name}, holds no certificates in PEM") from error
    except OSError as error:
        raise OptionError(
            f"the certificates in {shown(place)}, named by {name}, cannot be read: {error.strerror or error}"
        ) from error
