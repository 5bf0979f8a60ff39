"""meshtide's server: hosts a folder of meshes, over HTTP as files and over websockets level by level.

>>> from meshtide_server import Settings, create_app
>>> app = create_app(Settings(samples=True))
>>> app.title
'meshtide'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_server.app import create_app
    from meshtide_server.settings import Settings

_HOMES = {"Settings": "settings", "create_app": "app"}

__all__ = ["Settings", "create_app"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
