from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from meshtide_codec.command_line import ExitCode, exit_code
from meshtide_codec.errors import MissingLibraryError
from meshtide_codec.extras import check_extras, extra


def test_a_module_that_is_there_is_loaded() -> None:
    assert extra("json") is json
    check_extras("json", "math")


def test_a_missing_library_is_told_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "json", None)
    with pytest.raises(
        MissingLibraryError, match=r"needs json, which is not installed: pip install 'meshtide\[bench\]'"
    ):
        check_extras("math", "json")
    with pytest.raises(MissingLibraryError, match=r"'meshtide\[lab\]'"):
        check_extras("math", "json", group="lab")


def test_a_library_that_is_broken_is_told_with_the_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "a_broken_library.py").write_text("raise ImportError('libpart.so is missing')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        MissingLibraryError, match=r"a_broken_library, which cannot be loaded \(libpart.so is missing\)"
    ):
        extra("a_broken_library")


def test_what_lacks_a_library_is_a_matter_of_usage() -> None:
    assert exit_code(MissingLibraryError("this needs json")) == ExitCode.USAGE
