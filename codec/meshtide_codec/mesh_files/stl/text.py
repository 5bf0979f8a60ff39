"""STL in text form: the three numbers behind each word "vertex", of any number of solids.

Words may be of any case and stand on lines as they like. A facet has three vertices; "outer loop", "endloop",
"endfacet" and normals (which may be nan) are passed over, so that files without them are read. The last solid must be
ended by "endsolid": without it the file is taken for cut short. The rest of a line that begins with "solid" or
"endsolid" is a name, unless a facet follows on it. Other words are reported. All is found by comparing bytes as arrays.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import plain_text, refuse_control
from meshtide_codec.mesh_files.text_numbers import BLANK, leading_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits

_INT32 = 1 << 31
_FACET = re.compile(rb"\sfacet\s+normal\s+[-+.\dni]")
_NUMBER_STARTS = np.zeros(256, bool)
_NUMBER_STARTS[list(b"+-.0123456789")] = True
_KNOWN = (b"vertex", b"facet", b"normal", b"outer", b"loop", b"endloop", b"endfacet", b"nan", b"inf", b"infinity")
_BLANKS = bytes(range(BLANK + 1))
_IN_A_FACET = np.frombuffer(b"fnolvvvee", np.uint8)
"""The first letters of the words of a facet: facet normal, outer loop, three times vertex, endloop, endfacet."""


def read_text_corners(data: bytes, limits: FileLimits) -> tuple[NDArray[np.float64], list[str]]:
    """The corners (3 m, 3) of all facets, and notes for the person who reads the file.

    Raises:
        MeshFileError: a facet has not three vertices, a vertex not three numbers, the end is missing, or there is
            too much.
    """
    text, ended = _without_names(plain_text(data).lower())
    refuse_control(text, len(text.rstrip(_BLANKS)))
    raw = np.frombuffer(text, np.uint8)
    begins = raw > BLANK
    begins[1:] &= raw[:-1] <= BLANK
    starts: NDArray[np.signedinteger] = np.flatnonzero(begins).astype(np.int32 if len(raw) < _INT32 else np.int64)
    del begins
    letters = np.flatnonzero(~_NUMBER_STARTS[raw[starts]])  # words that are not numbers, but nan and inf
    vertex, facet = _are(raw, starts[letters], b"vertex"), _are(raw, starts[letters], b"facet")
    corners, facets = int(vertex.sum()), int(facet.sum())
    limits.check_counts(corners, facets)
    if facets and not ended:
        raise MeshFileError("the STL file is cut short: no endsolid follows its last facet")
    of_facet = np.cumsum(facet, dtype=np.int32)[vertex]
    if facets == 0 or corners != 3 * facets or (of_facet != np.repeat(np.arange(1, facets + 1), 3)).any():
        message = f"the STL file has {facets} facets and {corners} vertices, which are three for each facet"
        raise MeshFileError(message)
    notes = _other_words(raw, starts[letters])
    return _numbers(raw, starts, letters[vertex]), notes


def _without_names(text: bytes) -> tuple[bytes, bool]:
    """The text with blanks in place of "solid", "endsolid" and the names behind them; whether the last one is ended."""
    pieces: list[bytes] = []
    ended = False
    done = passed = line_end = 0
    while (place := text.find(b"solid", passed)) >= 0:
        line = text.rfind(b"\n", passed, place) + 1 or passed  # where the line begins, or what was passed ends
        before = text[line:place]
        ends = before.endswith(b"end") and not before[:-3][-1:].strip()
        follows = text[place + 5 : place + 6].strip()
        at_start = not before.strip() and (line == 0 or text[line - 1 : line] == b"\n")
        passed = place + 5
        if follows or not (ends or at_start):
            continue
        if line_end < passed:
            line_end = text.find(b"\n", passed)
            line_end = len(text) if line_end < 0 else line_end
        facet = _FACET.search(text, place, line_end)
        passed = line_end if facet is None else facet.start()
        begin = place - 3 if ends else place
        pieces += [text[done:begin], b" " * (passed - begin)]
        done = passed
        ended = ends
    rest = text[done:]
    return b"".join([*pieces, rest]), ended and b"facet" not in rest


def _are(raw: NDArray[np.uint8], starts: NDArray[np.signedinteger], word: bytes) -> NDArray[np.bool_]:
    """Which of the words that start there are this one."""
    same: NDArray[np.bool_] = raw[starts] == word[0]
    candidates = starts[same]
    fitting = candidates + len(word) <= len(raw)
    for place, byte in enumerate(word[1:], start=1):
        fitting &= raw[np.minimum(candidates + place, len(raw) - 1)] == byte
    behind = candidates + len(word)
    fitting &= (behind >= len(raw)) | (raw[np.minimum(behind, len(raw) - 1)] <= BLANK)
    same[same] = fitting
    return same


def _other_words(raw: NDArray[np.uint8], words: NDArray[np.signedinteger]) -> list[str]:
    """What to say of words that the format does not have, looked for by their first letters, then as a whole."""
    size = len(_IN_A_FACET)
    if len(words) % size == 0 and (raw[words].reshape(-1, size) == _IN_A_FACET).all():
        return []
    for word in _KNOWN:
        words = words[~_are(raw, words, word)]
    if len(words) == 0:
        return []
    shown = raw[words[0] : words[0] + 40].tobytes().split()[0].decode("ascii", "replace")
    return [f"{len(words)} words are not part of the format, such as {shown!r}: left out"]


def _numbers(
    raw: NDArray[np.uint8], starts: NDArray[np.signedinteger], places: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The three numbers (n, 3) behind each of the words at `places`."""
    if places[-1] + 3 >= len(starts):
        raise MeshFileError("the STL file is cut short within its last vertex")
    kept = np.zeros(len(starts), bool)
    for step in (1, 2, 3):
        kept[places + step] = True
    lengths = np.diff(starts, append=starts.dtype.type(len(raw)))  # of words with the blanks behind them
    chosen = np.repeat(kept, lengths)
    own = lengths[kept]
    ends = np.cumsum(own, dtype=starts.dtype)
    del kept, lengths
    text = raw[starts[0] :][chosen]
    del chosen
    values = leading_numbers(text, ends - own, len(text))
    if len(values) < 3 * len(places):
        vertex = len(values) // 3
        line = int((raw[: starts[places[vertex]]] == ord("\n")).sum()) + 1
        raise MeshFileError(
            f"line {line}: vertex {vertex % 3} of facet {vertex // 3} of the STL file has not three numbers"
        )
    return values.astype(np.float64, copy=False).reshape(-1, 3)
