from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.json_text import json_text

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(VALUES)
def test_what_is_text_comes_back_unchanged(value: object) -> None:
    assert json.loads(json_text(value)) == value
    assert json_text(value) == json.dumps(value)


@given(st.text(st.characters(codec=None), max_size=8))
def test_no_reader_meets_half_a_character(name: str) -> None:
    for value in ({name: 1}, [name], (name,), {"a": [{"b": name}]}):
        text = json_text(value)
        assert text.isascii()
        str(json.loads(text)).encode("utf-8")


def test_indented() -> None:
    assert json_text({"a": [1.5, "b\udc80"]}, indent=1) == '{\n "a": [\n  1.5,\n  "b\\\\udc80"\n ]\n}'
