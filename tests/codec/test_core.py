from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from meshtide_codec import core
from meshtide_codec.errors import CoreError, MeshtideError

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "codec" / "core"
SELF_CHECK = int(
    re.findall(r"MT_SELF_CHECK UINT64_C\((\w+)\)", (SOURCES / "include" / "meshtide.h").read_text())[0], 16
)


@pytest.fixture(autouse=True)
def _loads_anew() -> Iterator[None]:
    core.library.cache_clear()
    yield
    core.library.cache_clear()


@pytest.fixture(autouse=True)
def _no_other_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MESHTIDE_CORE", raising=False)


def libraries(folder: Path) -> None:
    for path in Path(core.__file__).parent.glob("libmeshtide_core_*"):
        shutil.copy(path, folder)


def test_every_kind_computes_the_same_bits() -> None:
    kinds = {"baseline", core.library().mt_best_kind().decode()}
    for kind in kinds:
        loaded = core.load(kind)
        assert loaded.mt_kind().decode() == kind
        assert loaded.mt_self_check() == SELF_CHECK
    assert core.library().mt_kind() == core.library().mt_best_kind()


def test_the_library_is_of_these_sources() -> None:
    assert core.library().mt_sources().decode() == core.sources_digest(SOURCES)


def test_an_edit_of_the_sources_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(SOURCES, tmp_path / "core")
    monkeypatch.setattr(core, "_SOURCES", tmp_path / "core")
    core.library()
    header = tmp_path / "core" / "src" / "base" / "lanes.hpp"
    header.write_bytes(header.read_bytes() + b"\n")
    core.library.cache_clear()
    with pytest.raises(CoreError, match=r"older than its sources in .*; run `pip install --editable /"):
        core.library()
    shutil.rmtree(tmp_path / "core")  # as where it was installed from a wheel
    core.library()


def test_a_folder_of_other_libraries_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    libraries(tmp_path)
    monkeypatch.setenv("MESHTIDE_CORE", str(tmp_path))
    assert core.library()._name.startswith(str(tmp_path))


def test_a_missing_core_is_one_sentence_with_a_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESHTIDE_CORE", str(tmp_path))
    with pytest.raises(CoreError, match=r"^the compiled core is missing: .*; run `pip install --editable ") as caught:
        core.library()
    assert isinstance(caught.value, MeshtideError)
    monkeypatch.setattr(core, "_SOURCES", tmp_path)
    with pytest.raises(CoreError, match=r"; run `pip install --force-reinstall --no-binary meshtide meshtide` to"):
        core.library()


def test_a_core_that_lacks_a_function_is_one_sentence_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(core._OTHERS, "mt_new_function", (None, ()))
    with pytest.raises(CoreError, match=r"it has no mt_new_function; run `pip install --editable "):
        core.library()


def test_a_core_of_another_platform_is_one_sentence_with_a_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    libraries(tmp_path)
    for path in tmp_path.iterdir():
        path.write_bytes(b"\x7fELF\x02\x01\x01" + b"\0" * 100)
    monkeypatch.setenv("MESHTIDE_CORE", str(tmp_path))
    with pytest.raises(
        CoreError, match=rf"^the compiled core cannot be loaded on this machine \({sys.platform}, .*; run"
    ):
        core.library()
