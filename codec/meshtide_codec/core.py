"""Loads the compiled core (codec/core, behind its C interface meshtide.h).

There is a library for each kind of processor, beside this file; all compute the same bits. The one of the baseline is
loaded first and asked which kind this machine runs best.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import sys
from importlib import resources
from pathlib import Path

from meshtide_codec.errors import CoreError

_SUFFIXES = {"darwin": ".dylib", "win32": ".dll"}
_SOURCES = Path(__file__).parents[1] / "core"
_REBUILD = f"run `pip install --editable {_SOURCES.parents[1]}` to build it anew"
_REINSTALL = "run `pip install --force-reinstall --no-binary meshtide meshtide` to build it here"


@functools.cache
def library() -> ctypes.CDLL:
    """The core for this machine, loaded once.

    The variable `MESHTIDE_CORE` names a folder with other libraries: those with sanitizers, or what is being measured.

    Raises:
        CoreError: it is missing, cannot be loaded here, or is older than its sources in this checkout.

    >>> library().mt_self_check() != 0
    True
    """
    folder = os.environ.get("MESHTIDE_CORE")
    core = load("baseline", folder)
    if core.mt_best_kind() != core.mt_kind():
        core = load(core.mt_best_kind().decode(), folder)
    if folder is None and (_SOURCES / "src").is_dir() and core.mt_sources().decode() != sources_digest(_SOURCES):
        raise CoreError(f"the compiled core is older than its sources in {_SOURCES}; {_REBUILD}")
    return core


def load(kind: str, folder: str | None = None) -> ctypes.CDLL:
    """The library of one kind of processor, which has to be one that this machine runs."""
    name = f"libmeshtide_core_{kind}{_SUFFIXES.get(sys.platform, '.so')}"
    remedy = _REBUILD if (_SOURCES / "src").is_dir() else _REINSTALL
    path = Path(folder or str(resources.files("meshtide_codec"))) / name
    if not path.is_file():
        raise CoreError(f"the compiled core is missing: there is no {path}; {remedy}")
    try:
        core = ctypes.CDLL(str(path))
    except OSError as error:
        raise CoreError(
            f"the compiled core cannot be loaded on this machine ({_machine()}): {error}; {remedy}"
        ) from error
    for function in (core.mt_kind, core.mt_best_kind, core.mt_sources):
        function.restype = ctypes.c_char_p
        function.argtypes = ()
    core.mt_self_check.restype = ctypes.c_uint64
    core.mt_self_check.argtypes = ()
    return core


def sources_digest(folder: Path) -> str:
    """The digest of the sources of the core that CMakeLists.txt puts into what it compiles."""
    files = [*folder.glob("src/**/*.cpp"), *folder.glob("src/**/*.hpp"), *folder.glob("include/**/*.h")]
    lines = [
        f"{file.relative_to(folder).as_posix()} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for file in files
    ]
    return hashlib.sha256("".join(sorted(lines)).encode()).hexdigest()


def _machine() -> str:
    return ", ".join(filter(None, (sys.platform, platform.machine(), " ".join(platform.libc_ver()).strip())))
