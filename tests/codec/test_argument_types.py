"""What is given in place of something else is told in a sentence, at every door of the codec."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import meshtide_codec
from meshtide_codec.argument_types import check_type
from meshtide_codec.testing import grid
from streams import encoded_grid

if TYPE_CHECKING:
    from collections.abc import Callable

MESH: Any = grid(4)
ENCODED: Any = encoded_grid()
NOTHING: Any = None
WRONG: dict[str, tuple[Callable[[Any], object], list[Any]]] = {
    "push": (lambda wrong: meshtide_codec.Decoder(ENCODED.header).push(wrong), [None, 3, b"packet", ENCODED]),
    "Decoder": (meshtide_codec.Decoder, [None, ENCODED.to_bytes()]),
    "limits": (lambda wrong: meshtide_codec.Decoder(ENCODED.header, wrong), [3, meshtide_codec.FileLimits()]),
    "decode": (meshtide_codec.decode, [None, "a.tide", 3]),
    "level": (lambda wrong: meshtide_codec.decode(ENCODED.to_bytes(), wrong), [None, "0", 0.0]),
    "encode": (meshtide_codec.encode, [None, "a.ply", [[0, 0, 0]]]),
    "options": (lambda wrong: meshtide_codec.encode(MESH, wrong), [12, {"bits": 12}, "compact"]),
    "grid": (lambda wrong: meshtide_codec.encode(MESH, grid=wrong), [3, (0.0, 0.0, 0.0)]),
    "threads": (lambda wrong: meshtide_codec.encode(MESH, threads=wrong), ["2", 2.5]),
    "save_mesh": (lambda wrong: meshtide_codec.save_mesh(wrong, "never-written.ply"), [None, "a.ply"]),
    "save_scene": (lambda wrong: meshtide_codec.save_scene(wrong, "never-written.ply"), [None, MESH]),
    "load_mesh": (meshtide_codec.load_mesh, [None, 3]),
    "load_scene": (meshtide_codec.load_scene, [None, 3]),
    "read_container": (meshtide_codec.read_container, [None, "a.tide"]),
    "read_available": (meshtide_codec.read_available, [None, "a.tide"]),
    "ContainerReader": (meshtide_codec.ContainerReader, [3]),
    "feed": (lambda wrong: meshtide_codec.ContainerReader().feed(wrong), [None, "TIDE"]),
    "merged_by_quantization": (lambda wrong: meshtide_codec.merged_by_quantization(MESH, wrong), [None, MESH]),
    "in_input_order": (lambda wrong: meshtide_codec.in_input_order(MESH, wrong), [None, MESH]),
}


@pytest.mark.parametrize("door", WRONG)
def test_a_wrong_type_is_told(door: str) -> None:
    call, arguments = WRONG[door]
    for wrong in arguments:
        with pytest.raises(TypeError, match=rf"not (<class ')?{type(wrong).__name__}\b"):
            call(wrong)


def test_subclasses_are_right() -> None:
    check_type("a number", True, int)
    check_type("a number", 3, str, int)
    with pytest.raises(TypeError, match="^a number must be of type str or float, not int; write it so$"):
        check_type("a number", 3, str, float, remedy="write it so")
