"""The version of this program, as it is installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """Version of the installed distribution."""
    try:
        return version("meshtide")
    except PackageNotFoundError:
        return "0"
