from __future__ import annotations

import json
import sys

import pytest

from meshtide_codec.errors import MeshtideError
from meshtide_codec.extras import check_extras, extra


def test_a_module_that_is_there_is_loaded() -> None:
    assert extra("json") is json
    check_extras("json", "math")


def test_a_missing_library_is_told_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "json", None)
    with pytest.raises(MeshtideError, match=r"this needs json: pip install 'meshtide\[bench\]'"):
        check_extras("math", "json")
    with pytest.raises(MeshtideError, match=r"'meshtide\[lab\]'"):
        check_extras("math", "json", group="lab")
