"""What pip calls to build meshtide (PEP 517): scikit-build-core, and a C++ compiler from PyPI where there is none.

A compiler is one that knows C++20 and vectors as the core uses them (g++ 12, clang++ 12, or newer). `CXX` names another
one, which is then taken as it is. Zig's, which is clang with a C++ library that it builds when it is first used, takes
two to three times as long, and 400 MB.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

from scikit_build_core import build as cmake
from scikit_build_core.build import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    Settings = Mapping[str, list[str] | str] | None

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

ZIG = "ziglang==0.17.1"
PROBE = """
#include <bit>
#include <vector>
typedef int Lanes __attribute__((vector_size(16)));
Lanes turned(Lanes a) { return __builtin_shufflevector(a, a, 1, 2, 3, 0); }
"""


def compiles(compiler: str) -> bool:
    """Whether there is such a compiler, and it knows what the core needs."""
    if shutil.which(compiler) is None:
        return False
    command = [compiler, "-std=c++20", "-fsyntax-only", "-x", "c++", "-"]
    return subprocess.run(command, input=PROBE.encode(), capture_output=True, check=False).returncode == 0  # noqa: S603


def compiler() -> str | None:
    """The compiler of this machine that builds the core, None if there is none."""
    return os.environ.get("CXX") or next(filter(compiles, ("c++", "g++", "clang++")), None)


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What to install before a wheel is built."""
    return [*cmake.get_requires_for_build_wheel(config_settings), *([] if compiler() else [ZIG])]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """What to install before an editable wheel is built."""
    return [*cmake.get_requires_for_build_editable(config_settings), *([] if compiler() else [ZIG])]


def tell_cmake() -> None:
    """Names the compiler to CMake, in the way that environments do."""
    found = compiler()
    os.environ["CXX"] = found or f"{sys.executable} -m ziglang c++"
    if found is None:  # what CMake asks a compiler would make Zig build its C++ library twice, once in vain
        known = {"FORCED": "ON", "ID_RUN": "ON", "ID": "Clang", "VERSION": "22.1.8"}
        told = [f"-DCMAKE_CXX_COMPILER_{name}={value}" for name, value in known.items()]
        os.environ["CMAKE_ARGS"] = " ".join(filter(None, (os.environ.get("CMAKE_ARGS"), *told)))


def build_wheel(folder: str, config_settings: Settings = None, metadata: str | None = None) -> str:
    """Build a wheel."""
    tell_cmake()
    return cmake.build_wheel(folder, config_settings, metadata)


def build_editable(folder: str, config_settings: Settings = None, metadata: str | None = None) -> str:
    """Build an editable wheel."""
    tell_cmake()
    return cmake.build_editable(folder, config_settings, metadata)
