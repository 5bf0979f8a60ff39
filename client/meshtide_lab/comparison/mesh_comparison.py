"""One mesh through meshtide, Draco and a ladder of Draco files: sizes, times, and what can be seen after which bytes.

Times are processor time of this process, of runs after a first one that loaded libraries; all candidates are timed in
the same process, one after the other.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshError
from meshtide_codec.report.states import StreamState, stream_states
from meshtide_lab.comparison.draco import draco_decoded, draco_encoded
from meshtide_lab.comparison.ladder import LadderLevels

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.encoder import EncodedMesh
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.profile import Profile
    from meshtide_codec.quantize import QuantizedMesh

Result = TypeVar("Result")

MESHTIDE = "meshtide"
LADDER = "ladder"
FITTED_LADDER = "ladder, fitted steps"
RUNS = 3
"""Decoding is timed so often, and the median counts; encoding, which takes far longer, is timed once."""


@dataclass(frozen=True, slots=True)
class CodedFile:
    """A whole file and what it took.

    Args:
        size: bytes.
        encode_seconds: processor time of encoding.
        decode_seconds: processor time of decoding all of it.
    """

    size: int
    encode_seconds: float
    decode_seconds: float


@dataclass(frozen=True, slots=True)
class MeshComparison:
    """What was found for one mesh at one quantization.

    Args:
        name: of the mesh.
        bits: B, bits per coordinate of all candidates.
        vertices: of the input, by which bits per vertex are counted.
        faces: of the input.
        meshtide: the stream, previews included.
        bare_size: bytes of the stream without previews, None for a profile that has none.
        exact: whether the stream decodes to the quantized input.
        draco: the Draco file, None if Draco cannot take the mesh.
        curves: states by the name of the candidate; candidates that cannot take the mesh are missing.
        problems: why something is missing.
    """

    name: str
    bits: int
    vertices: int
    faces: int
    meshtide: CodedFile
    bare_size: int | None
    exact: bool
    draco: CodedFile | None
    curves: dict[str, list[StreamState]]
    problems: list[str]

    @property
    def whole_size(self) -> int:
        """Bytes of the stream as a single file is best compared: without previews, if there are any."""
        return self.meshtide.size if self.bare_size is None else self.bare_size

    @property
    def ratio(self) -> float | None:
        """`whole_size` against Draco's."""
        return None if self.draco is None else self.whole_size / self.draco.size

    @property
    def ratio_with_previews(self) -> float | None:
        """The whole stream against Draco's file."""
        return None if self.draco is None else self.meshtide.size / self.draco.size

    def bits_per_vertex(self, size: int) -> float:
        """Bits per vertex of the input."""
        return 8 * size / self.vertices


def compare_mesh(
    name: str, mesh: Mesh, options: Profile, progress: Callable[[str, float], None] | None = None
) -> MeshComparison:
    """Code `mesh` with all candidates and measure them.

    Args:
        name: what to call the mesh.
        mesh: it.
        options: of meshtide; their `bits` are those of all candidates.
        progress: is called with a stage and the fraction done.

    Raises:
        MeshError: meshtide cannot take the mesh; that a peer cannot is noted in the result.
        MissingLibraryError: a library of the extra `bench` is missing.
    """
    report = progress or (lambda _stage, _fraction: None)
    report(f"{name}, meshtide", 0.0)
    bare = len(encode(mesh, replace(options, previews=())).to_bytes()) if isinstance(options, CompactOptions) else None
    encoded, encode_seconds = _timed(lambda: encode(mesh, options), 1)
    data = encoded.to_bytes()
    decoded, decode_seconds = _timed(lambda: decode(data), RUNS)
    expected = encoded.quantized.mesh()
    report(f"{name}, Draco", 0.4)
    problems: list[str] = []
    draco, draco_data = _draco_file(mesh, options.bits, problems)
    report(f"{name}, distances", 0.5)
    curves = _curves(encoded, draco_data, problems)
    report(f"{name}, distances", 1.0)
    return MeshComparison(
        name=name,
        bits=options.bits,
        vertices=len(mesh.vertices),
        faces=len(mesh.faces),
        meshtide=CodedFile(len(data), encode_seconds, decode_seconds),
        bare_size=bare,
        exact=bool(
            np.array_equal(decoded.vertices, expected.vertices) and np.array_equal(decoded.faces, expected.faces)
        ),
        draco=draco,
        curves=curves,
        problems=problems,
    )


def _draco_file(mesh: Mesh, bits: int, problems: list[str]) -> tuple[CodedFile | None, bytes]:
    try:
        data, encode_seconds = _timed(lambda: draco_encoded(mesh.vertices, mesh.faces, bits), RUNS)
        _, decode_seconds = _timed(lambda: draco_decoded(data), RUNS)
    except MeshError as error:
        problems.append(str(error))
        return None, b""
    return CodedFile(len(data), encode_seconds, decode_seconds), data


def _curves(encoded: EncodedMesh, draco_data: bytes, problems: list[str]) -> dict[str, list[StreamState]]:
    quantized: QuantizedMesh = encoded.quantized
    meter = DistortionMeter(quantized.positions.astype(np.float64), quantized.faces)
    curves = {MESHTIDE: stream_states(encoded, meter)}
    if not draco_data:
        return curves
    if not len(quantized.faces):
        problems.append("a mesh without faces has no ladder of levels of detail")
        return curves
    try:
        levels = LadderLevels(quantized, meter)
        ladder = levels.climbed(draco_data, fitted_steps=False)
        fitted = levels.climbed(draco_data, fitted_steps=True)
    except MeshError as error:
        problems.append(f"ladder: {error}")
        return curves
    return curves | {LADDER: ladder, FITTED_LADDER: fitted}


def _timed(work: Callable[[], Result], runs: int) -> tuple[Result, float]:
    """What `work` returns, and its median processor time."""
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        result = work()
        seconds.append(time.process_time() - start)
    return result, statistics.median(seconds)
