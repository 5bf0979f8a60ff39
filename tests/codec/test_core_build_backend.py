"""How the build decides whether it needs a compiler from PyPI."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

SOURCES = Path(__file__).parents[2] / "codec" / "core"


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The backend, without scikit-build-core, which only build environments have."""
    hooks = dict.fromkeys(
        [
            "build_sdist",
            "get_requires_for_build_sdist",
            "prepare_metadata_for_build_editable",
            "prepare_metadata_for_build_wheel",
            "build_wheel",
            "build_editable",
        ]
    )
    fake = ModuleType("scikit_build_core.build")
    fake.__dict__.update(
        hooks, get_requires_for_build_wheel=lambda _: ["ninja"], get_requires_for_build_editable=lambda _: ["ninja"]
    )
    package = ModuleType("scikit_build_core")
    package.__dict__["build"] = fake
    monkeypatch.setitem(sys.modules, "scikit_build_core", package)
    monkeypatch.setitem(sys.modules, "scikit_build_core.build", fake)
    monkeypatch.delenv("CXX", raising=False)
    specification = importlib.util.spec_from_file_location("build_backend", SOURCES / "build_backend.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def compiler(folder: Path, name: str, code: int) -> None:
    path = folder / name
    path.write_text(f"#!/bin/sh\nexit {code}\n")
    path.chmod(0o755)


def test_no_compiler_means_zig(backend: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    for requires in (backend.get_requires_for_build_wheel, backend.get_requires_for_build_editable):
        assert requires() == ["ninja", backend.ZIG]
    compiler(tmp_path, "c++", 1)  # as one that is too old, or that only says what to install
    assert backend.compiler() is None
    compiler(tmp_path, "clang++", 0)
    assert backend.compiler() == "clang++"
    assert backend.get_requires_for_build_wheel() == ["ninja"]


def test_what_builds_here_is_found(backend: ModuleType) -> None:
    if shutil.which("g++") is None:
        pytest.skip("there is no g++")
    assert backend.compiles("g++")
    assert not backend.compiles("no-such-compiler")


def test_a_compiler_that_is_named_is_taken(
    backend: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CXX", "ccache g++")
    assert backend.compiler() == "ccache g++"
    assert backend.get_requires_for_build_editable() == ["ninja"]


def test_the_compiler_is_handed_to_cmake(backend: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    build = lambda *_: seen.append(os.environ["CXX"])  # noqa: E731
    monkeypatch.setattr(backend, "cmake", SimpleNamespace(build_wheel=build, build_editable=build))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CXX", "")
    monkeypatch.setenv("CMAKE_ARGS", "-DA=1")
    backend.build_wheel("wheels")
    assert os.environ["CMAKE_ARGS"].startswith("-DA=1 -DCMAKE_CXX_")
    monkeypatch.setenv("CXX", "g++-14")
    backend.build_editable("wheels")
    assert seen == [f"{sys.executable} -m ziglang c++", "g++-14"]
