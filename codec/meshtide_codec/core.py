"""The compiled core (codec/core), loaded and called: all of its C interface that Python uses, meshtide.h, stands here.

There is a library for each kind of processor, beside this file; all compute the same bits. The one of the baseline is
loaded first and asked which kind this machine runs best. Other threads run while the core works.

::

    handle = Handle("mt_encoder_free")
    call("mt_encoder_new", positions, len(positions), ..., byref(handle))      # raises what the core refuses
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import sys
from ctypes import POINTER, byref, c_char_p, c_double, c_int32, c_int64, c_uint8, c_uint32, c_uint64, c_void_p, cast
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import (
    BaseError,
    ContainerError,
    CoreError,
    DiffError,
    LimitError,
    MapConnError,
    MeshtideError,
    OptionError,
    PacketError,
    ParamError,
    VersionError,
)

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

    from meshtide_codec.limits import Limits

_SUFFIXES = {"darwin": ".dylib", "win32": ".dll"}
_HERE = Path(__file__).parent
_SOURCES = _HERE.parent / "core"
_REBUILD = f"run `pip install --editable {_SOURCES.parents[1]}` to build it anew"
_REINSTALL = "run `pip install --force-reinstall --no-binary meshtide meshtide` to build it here"


class Bytes(ctypes.Structure):
    """mt_bytes: bytes that are lent."""

    _fields_ = (("data", c_void_p), ("size", c_uint64))

    @classmethod
    def lent(cls, data: bytes) -> Bytes:
        """The bytes, which are kept as long as this is."""
        lent = cls(cast(c_char_p(data), c_void_p), len(data))
        lent._kept = data
        return lent

    def copied(self) -> bytes:
        """The bytes."""
        return ctypes.string_at(self.data, self.size) if self.size else b""


class Error(ctypes.Structure):
    """mt_error: why a function failed."""

    _fields_ = (
        ("fault", c_int32),
        ("kind", c_int32),
        ("level", c_int32),
        ("slice", c_int32),
        ("offset", c_int64),
        ("claimed", c_uint64),
        ("allowed", c_uint64),
        ("text", c_char_p),
    )


class Limited(ctypes.Structure):
    """mt_limits, the fields of `Limits` in their order."""

    _fields_ = tuple(
        (name, c_uint64)
        for name in (
            "vertices",
            "faces",
            "levels",
            "packets",
            "header_bytes",
            "packet_bytes",
            "memory",
            "vertices_per_byte",
            "faces_per_byte",
        )
    )

    @classmethod
    def of(cls, limits: Limits) -> Limited:
        """The same limits."""
        return cls(*(min(getattr(limits, field[0]), _LARGEST) for field in cls._fields_))


class Header(ctypes.Structure):
    """mt_header: what `StreamHeader` says."""

    _fields_ = (
        ("profile", c_int32),
        ("bits", c_int32),
        ("origin", c_double * 3),
        ("extent", c_double),
        ("packets", c_void_p),
        ("packet_count", c_uint64),
        ("states", c_void_p),
        ("state_count", c_uint64),
        ("effort", c_int32),
        ("mirror_axis", c_int32),
        ("mirror_sum", c_int32),
        ("base_depth", c_int32),
        ("diff_depths", c_uint32),
        ("previews", c_uint32),
        ("strengths", c_uint8 * 24),
        ("slices", c_void_p),
        ("slice_count", c_uint64),
        ("levels", c_uint32),
        ("diffs", c_uint32),
        ("shifts", c_uint8 * 24),
        ("filter", c_int32),
        ("degree", c_int32),
        ("denominator_degree", c_int32),
        ("chebyshev", c_int32),
        ("norm", c_double),
        ("taubin_lambda", c_double),
        ("taubin_mu", c_double),
    )


PACKET = np.dtype([("length", "u8"), ("checksum", "u4"), ("slice", "u2"), ("level", "u1"), ("kind", "u1")])
"""mt_packet."""
STATE = np.dtype(
    [("vertices", "u8"), ("faces", "u8"), ("rms", "f8"), ("maximum", "f8"), ("packet_count", "u4"), ("level", "u4")]
)
"""mt_state."""


class Shown(ctypes.Structure):
    """mt_shown: what is drawn of a level."""

    _fields_ = (
        ("positions", c_void_p),
        ("vertex_count", c_uint64),
        ("faces", c_void_p),
        ("face_count", c_uint64),
    )

    def copied_positions(self) -> NDArray[np.float64]:
        """(n, 3) float64."""
        return copied(self.positions, (self.vertex_count, 3), np.float64)

    def copied_faces(self) -> NDArray[np.int32]:
        """(m, 3) int32."""
        return copied(self.faces, (self.face_count, 3), np.int32)


class EncoderOptions(ctypes.Structure):
    """mt_encoder_options."""

    _fields_ = (
        ("bits", c_int32),
        ("effort", c_int32),
        ("mirror_axis", c_int32),
        ("mirror_sum", c_int32),
        ("slices", c_void_p),
        ("slice_count", c_uint64),
    )


class Diffs(ctypes.Structure):
    """mt_diffs: the Diffs of a packet."""

    _fields_ = (("values", c_void_p), ("count", c_uint64), ("level", c_int32), ("slice", c_int32))

    def copied_values(self) -> NDArray[np.float64]:
        """(n, 3) float64, in steps of the level's grid."""
        return copied(self.values, (self.count, 3), np.float64)


class GraphLists(ctypes.Structure):
    """mt_graph_lists: the neighbours of every vertex."""

    _fields_ = (
        ("offsets", c_void_p),
        ("neighbours", c_void_p),
        ("vertex_count", c_uint64),
        ("neighbour_count", c_uint64),
    )


class Filter(ctypes.Structure):
    """mt_filter."""

    _fields_ = (
        ("kind", c_int32),
        ("chebyshev", c_int32),
        ("degree", c_int32),
        ("denominator_degree", c_int32),
        ("taubin_lambda", c_double),
        ("taubin_mu", c_double),
    )


class GridMesh(ctypes.Structure):
    """mt_grid_mesh: a mesh on a grid, lent."""

    _fields_ = (
        ("positions", c_void_p),
        ("vertex_count", c_uint64),
        ("faces", c_void_p),
        ("face_count", c_uint64),
        ("bits", c_int32),
    )

    @classmethod
    def lent(cls, positions: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> GridMesh:
        """The mesh of arrays (n, 3) and (m, 3), which are kept as long as this is."""
        mesh = cls(positions.ctypes.data, len(positions), faces.ctypes.data, len(faces), bits)
        mesh._kept = positions, faces
        return mesh

    def copied_positions(self) -> NDArray[np.int32]:
        """(n, 3) int32."""
        return copied(self.positions, (self.vertex_count, 3), np.int32)

    def copied_faces(self) -> NDArray[np.int32]:
        """(m, 3) int32."""
        return copied(self.faces, (self.face_count, 3), np.int32)


class Preview(ctypes.Structure):
    """mt_preview."""

    _fields_ = (("mesh", GridMesh), ("payload", Bytes))


class Surface(ctypes.Structure):
    """mt_surface: vertices and faces, lent."""

    _fields_ = (("vertices", c_void_p), ("vertex_count", c_uint64), ("faces", c_void_p), ("face_count", c_uint64))

    @classmethod
    def lent(cls, vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Surface:
        """The surface of arrays (n, 3) and (m, 3), which are kept as long as this is."""
        surface = cls(vertices.ctypes.data, len(vertices), faces.ctypes.data, len(faces))
        surface.kept = vertices, faces
        return surface


class Points(ctypes.Structure):
    """mt_points: where points of a surface are to be written."""

    _fields_ = (("points", c_void_p), ("corners", c_void_p), ("weights", c_void_p))


class InputOrder(ctypes.Structure):
    """mt_input_order."""

    _fields_ = (("vertices", c_void_p), ("vertex_count", c_uint64), ("faces", c_void_p), ("face_count", c_uint64))

    @classmethod
    def lent(cls, vertices: NDArray[np.uint32], faces: NDArray[np.uint32]) -> InputOrder:
        """The order of arrays (n,) and (m, 3), which are kept as long as this is."""
        order = cls(vertices.ctypes.data, len(vertices), faces.ctypes.data, len(faces))
        order._kept = vertices, faces
        return order


class StreamMesh(ctypes.Structure):
    """mt_stream_mesh: the faces of a stream's finest mesh, lent."""

    _fields_ = (("faces", c_void_p), ("face_count", c_uint64), ("vertex_count", c_uint64))

    @classmethod
    def lent(cls, faces: NDArray[np.int32], vertex_count: int) -> StreamMesh:
        """The mesh of the array (m, 3), which is kept as long as this is."""
        mesh = cls(faces.ctypes.data, len(faces), vertex_count)
        mesh._kept = faces
        return mesh


def _array(dtype: DTypeLike) -> Any:  # noqa: ANN401 - numpy's own type for it is not public
    return np.ctypeslib.ndpointer(dtype, flags="C_CONTIGUOUS")


_HANDLE = c_void_p
_BYTES, _INTS, _FLOATS, _CODES = _array(np.uint8), _array(np.int32), _array(np.float64), _array(np.uint64)
_SINGLES = _array(np.float32)

_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "mt_stream_parse": (c_char_p, c_uint64, POINTER(Limited), POINTER(_HANDLE)),
    "mt_stream_write": (POINTER(Header), POINTER(_HANDLE), POINTER(Bytes)),
    "mt_states_load": (_HANDLE, c_int32, c_char_p, c_uint64),
    "mt_decoder_new": (_HANDLE, POINTER(Limited), _HANDLE, POINTER(_HANDLE)),
    "mt_decoder_push": (_HANDLE, c_int32, c_int32, c_int32, c_char_p, c_uint64),
    "mt_decoder_show": (_HANDLE, c_int32, POINTER(Shown)),
    "mt_decoder_diffs": (_HANDLE, c_uint64, POINTER(Diffs)),
    "mt_decoder_replace_diffs": (_HANDLE, c_uint64, _FLOATS, c_uint64),
    "mt_encoder_new": (_INTS, c_uint64, _INTS, c_uint64, POINTER(EncoderOptions), _HANDLE, POINTER(_HANDLE)),
    "mt_encoder_base": (_HANDLE, c_int32, POINTER(Bytes)),
    "mt_encoder_next_level": (_HANDLE, POINTER(Bytes)),
    "mt_encoder_add_planes": (_HANDLE, c_int32, c_int32, POINTER(c_uint64)),
    "mt_encoder_take_planes": (_HANDLE, c_int32, POINTER(Bytes)),
    "mt_encoder_strengths": (_HANDLE, c_int32, _BYTES),
    "mt_encoder_show": (_HANDLE, c_int32, c_int32, c_int32, _FLOATS, _INTS),
    "mt_classic_encoder_new": (_HANDLE, POINTER(_HANDLE)),
    "mt_classic_encoder_base": (_HANDLE, _INTS, c_uint64, c_int32, _INTS, c_uint64, POINTER(Bytes)),
    "mt_classic_encoder_map_conn": (_HANDLE, _INTS, c_uint64, _INTS, c_uint64, POINTER(Bytes)),
    "mt_classic_encoder_diff": (_HANDLE, _INTS, c_uint64, POINTER(Bytes)),
    "mt_classic_decode_diff": (c_int32, c_char_p, c_uint64, c_uint64, _INTS),
    "mt_graph_new": (_INTS, c_uint64, c_uint64, POINTER(_HANDLE)),
    "mt_graph_apply": (_HANDLE, _FLOATS, c_int32, _FLOATS),
    "mt_graph_predict": (_HANDLE, POINTER(Filter), _SINGLES, _FLOATS, _FLOATS),
    "mt_graph_divide": (_HANDLE, _SINGLES, c_uint64, _FLOATS),
    "mt_find_mirror": (_INTS, c_uint64, c_int32, POINTER(c_int32), POINTER(c_int32)),
    "mt_previews_choose": (POINTER(GridMesh), _HANDLE, POINTER(_HANDLE)),
    "mt_previews_make": (POINTER(GridMesh), _CODES, c_uint64, _HANDLE, POINTER(_HANDLE)),
    "mt_tree_new": (POINTER(Surface), POINTER(_HANDLE)),
    "mt_tree_closest": (_HANDLE, _FLOATS, c_uint64, POINTER(Points)),
    "mt_tree_sample": (_HANDLE, c_uint64, c_uint64, POINTER(Points)),
    "mt_meter_new": (POINTER(Surface), c_uint64, c_uint64, c_uint64, POINTER(_HANDLE)),
    "mt_meter_measure": (_HANDLE, POINTER(Surface), POINTER(c_double), POINTER(c_double)),
    "mt_simplifier_new": (POINTER(GridMesh), c_uint64, POINTER(_HANDLE)),
    "mt_simplifier_reduce": (_HANDLE, c_uint64, POINTER(Surface)),
    "mt_order_encode": (POINTER(InputOrder), POINTER(StreamMesh), POINTER(_HANDLE), POINTER(Bytes)),
    "mt_order_decode": (
        POINTER(Bytes),
        POINTER(StreamMesh),
        POINTER(Limited),
        c_uint64,
        POINTER(_HANDLE),
        POINTER(InputOrder),
    ),
}
"""Functions that can fail, with their arguments but the error, which comes last."""

_OTHERS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "mt_kind": (c_char_p, ()),
    "mt_best_kind": (c_char_p, ()),
    "mt_sources": (c_char_p, ()),
    "mt_self_check": (c_uint64, ()),
    "mt_stored_distances": (None, (POINTER(c_double), POINTER(c_double))),
    "mt_stream_header": (POINTER(Header), (_HANDLE,)),
    "mt_stream_free": (None, (_HANDLE,)),
    "mt_states_new": (c_void_p, ()),
    "mt_decoder_free": (None, (_HANDLE,)),
    "mt_decoder_available": (c_uint64, (_HANDLE,)),
    "mt_decoder_exact": (c_uint64, (_HANDLE,)),
    "mt_decoder_changed": (c_uint64, (_HANDLE,)),
    "mt_decoder_map_bytes": (c_uint64, (_HANDLE,)),
    "mt_decoder_keep_finest_only": (None, (_HANDLE,)),
    "mt_decoder_watch_diffs": (None, (_HANDLE,)),
    "mt_decoder_diff_count": (c_uint64, (_HANDLE,)),
    "mt_encoder_free": (None, (_HANDLE,)),
    "mt_encoder_sizes": (c_int32, (_HANDLE, _CODES, _CODES)),
    "mt_encoder_finish": (None, (_HANDLE,)),
    "mt_classic_encoder_free": (None, (_HANDLE,)),
    "mt_graph_free": (None, (_HANDLE,)),
    "mt_graph_get_lists": (None, (_HANDLE, POINTER(GraphLists))),
    "mt_is_safe_denominator": (c_int32, (_SINGLES, c_uint64)),
    "mt_dot": (c_double, (_FLOATS, _FLOATS, c_uint64)),
    "mt_previews_free": (None, (_HANDLE,)),
    "mt_previews_count": (c_uint64, (_HANDLE,)),
    "mt_previews_list": (POINTER(Preview), (_HANDLE,)),
    "mt_tree_free": (None, (_HANDLE,)),
    "mt_meter_free": (None, (_HANDLE,)),
    "mt_simplifier_free": (None, (_HANDLE,)),
    "mt_order_free": (None, (_HANDLE,)),
}
"""Functions that cannot, with what they return."""

LARGEST_VERSION = 0x7F
"""A header that begins with a greater byte is none, of whatever version."""
_LARGEST = (1 << 64) - 1
_MALFORMED, _LIMIT, _MEMORY, _ARGUMENT, _VERSION = range(1, 6)
_KINDS = ("Base", "Map&Conn", "Param", "Diff", "Preview", "Order")
_PACKET_ERRORS = {"Base": BaseError, "Map&Conn": MapConnError, "Param": ParamError, "Diff": DiffError}


class Handle:
    """Something that the core has made, freed with this object.

    Args:
        free: name of the function that frees it.
    """

    def __init__(self, free: str) -> None:
        self.pointer = c_void_p()
        self._free = getattr(library(), free)

    @property
    def _as_parameter_(self) -> c_void_p:
        return self.pointer

    def __del__(self) -> None:
        if getattr(self, "pointer", None):
            self._free(self.pointer)


def call(name: str, *arguments: Any, argument_error: type[MeshtideError] = OptionError) -> None:  # noqa: ANN401
    """Call a function of the core that can fail.

    Args:
        name: of the function.
        arguments: its arguments but the error.
        argument_error: what to raise where the arguments are not what it takes.

    Raises:
        StreamError: the bytes are damaged, over the limits, or of another format.
        CoreError: the system has no memory left, or the core has a bug.
    """
    error = Error()
    if getattr(library(), name)(*arguments, byref(error)):
        raise exception(error, argument_error)


def exception(error: Error, argument_error: type[MeshtideError] = OptionError) -> MeshtideError:
    """The exception that says what an error of the core says."""
    text = (error.text or b"").decode()
    kind = _KINDS[error.kind] if error.kind >= 0 else None
    level = error.level if error.level >= 0 else None
    offset = error.offset if error.offset >= 0 else None
    if error.fault == _ARGUMENT:
        return argument_error(text)
    if error.fault == _VERSION and error.claimed <= LARGEST_VERSION:
        return version_error(error.claimed, error.allowed)
    if error.fault == _VERSION:
        return ContainerError("damaged stream header: it does not begin as headers do", offset=0)
    if error.fault == _LIMIT:
        return LimitError(_limit_text(text, error.claimed, error.allowed), level=level, packet=kind)
    if error.fault == _MALFORMED and kind is None:
        return ContainerError(f"damaged stream header: {text}", offset=offset)
    if error.fault == _MALFORMED:
        return _PACKET_ERRORS.get(kind or "", PacketError)(text, level=level, packet=kind, offset=offset)
    if error.fault == _MEMORY:
        return CoreError(text)
    return CoreError(f"a bug in the core: {text}; please report what you did")


def version_error(version: int, own: int) -> VersionError:
    """What to say of a stream of another format version."""
    if version < own:
        return VersionError(f"the stream was written by an older meshtide (format {version}): encode it again")
    return VersionError(
        f"the stream was written by a newer meshtide (format {version}; this one reads format {own}): update meshtide"
    )


def _limit_text(name: str, claimed: int, allowed: int) -> str:
    """What is claimed and what is accepted, by the name of a limit; or a sentence of the core, as it is."""
    if " " in name:
        return name
    if name.endswith("_bytes"):
        what = name.removesuffix("_bytes")
        return f"the stream claims a {what} of {claimed} bytes; this decoder accepts {allowed} (Limits.{name})"
    if name.endswith("_per_byte"):
        what = name.removesuffix("_per_byte")
        return (
            f"the stream claims {claimed} {what} by so few bytes that this decoder accepts {allowed} "
            f"(Limits.{name}; --max-{what} for commands)"
        )
    return f"the stream claims {claimed} {name}; this decoder accepts {allowed} (Limits.{name})"


def copied(data: int | None, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array of its own with what the core lends at `data`."""
    made = np.empty(shape, dtype)
    if made.nbytes:
        ctypes.memmove(made.ctypes.data, data or 0, made.nbytes)
    return made


@functools.cache
def states(*efforts: int) -> Handle:
    """The trained states of efforts (0 default, 1 high) and of profile classic (2), loaded on first use."""
    handle = Handle("mt_states_free")
    handle.pointer = c_void_p(library().mt_states_new())
    for effort in efforts:
        name = ("default", "high", "classic")[effort]
        data = (_HERE / "states" / f"{name}.states").read_bytes()
        call("mt_states_load", handle, effort, data, len(data))
    return handle


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
    path = Path(folder or _HERE) / name
    if not path.is_file():
        raise CoreError(f"the compiled core is missing: there is no {path}; {remedy}")
    try:
        core = ctypes.CDLL(str(path))
    except OSError as error:
        raise CoreError(
            f"the compiled core cannot be loaded on this machine ({_machine()}): {error}; {remedy}"
        ) from error
    declared = {name: (c_int32, (*arguments, POINTER(Error))) for name, arguments in _FUNCTIONS.items()} | _OTHERS
    for function, (result, arguments) in declared.items():
        if not hasattr(core, function):
            raise CoreError(f"the compiled core {path} is older than this program: it has no {function}; {remedy}")
        getattr(core, function).restype = result
        getattr(core, function).argtypes = arguments
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
