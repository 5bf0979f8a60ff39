"""A sweep: streams x links x seeds, spread over processes, noted in a journal as it goes.

Every (mesh, variant) is encoded once. Results do not depend on the number of processes or on their order.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.errors import MeshError, MeshtideError, OptionError
from meshtide_codec.output_policy import check_different, output_file
from meshtide_codec.stream.container import read_available
from meshtide_lab.link.lossy_link import LossyLink
from meshtide_lab.simulation.journal import Journal
from meshtide_lab.simulation.sources import open_mesh
from meshtide_lab.simulation.variants import Variant
from meshtide_lab.simulation.worker import Batch, Run, do_batch, make_stream

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from meshtide_lab.simulation.sources import SweptMesh

RUNS_A_BATCH = 10
STREAMS = "streams"


@dataclass(frozen=True, slots=True)
class Sweep:
    """What to simulate.

    Args:
        meshes: files, sample names, `.tide` files, or URLs of hosted meshes.
        variants: how meshes are encoded; streams are taken as they are.
        losses: links in their textual form.
        seeds: of the links.
        unprotected: what links may lose besides Diffs.

    Raises:
        OptionError: the sweep is empty, or names something twice, or a link that cannot be.
    """

    meshes: tuple[str, ...]
    variants: tuple[Variant, ...]
    losses: tuple[str, ...]
    seeds: range
    unprotected: str = ""

    def __post_init__(self) -> None:
        for name in ("meshes", "variants", "losses", "seeds"):
            if not len(getattr(self, name)):
                raise OptionError(f"the sweep is empty: it has no {name}")
        for name in ("meshes", "losses"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise OptionError(f"the sweep names one of its {name} twice")
        for loss in self.losses:
            LossyLink.parse(loss, 0, self.unprotected)


@dataclass(frozen=True, slots=True)
class SweptStream:
    """One encoded mesh of a sweep."""

    source: SweptMesh
    variant: Variant
    path: Path


@dataclass(slots=True)
class SweepResults:
    """What a sweep has found.

    Args:
        runs: one row a run: stream, link, seed, and the figures of the finest level that was left.
        levels: one row for each level of each run.
        failures: what could not be read, encoded or run, and why.
        resumed: runs that were done before.
    """

    runs: list[dict[str, Any]] = field(default_factory=list)
    levels: list[dict[str, Any]] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    resumed: int = 0


def run_sweep(
    sweep: Sweep,
    folder: Path,
    *,
    processes: int = 1,
    overwrite: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> SweepResults:
    """Run what of a sweep is not done yet, and return all of it.

    Args:
        sweep: what to do.
        folder: for journal and streams; one that holds part of this very sweep is resumed.
        processes: how many share the work.
        overwrite: whether what the folder holds may be replaced, if it is anything else.
        progress: is called with a stage and the fraction of it that is done.

    Raises:
        OptionError: the folder holds another sweep, or results of another version, or a mesh of this one where a
            stream is to be written; or two meshes have one name.
        MeshError: none of the meshes could be encoded.
    """
    report = progress or (lambda _stage, _fraction: None)
    report("read", 0.0)
    results = SweepResults()
    sources = _open_meshes(sweep, results)
    check_different((source.name, source.place) for source in sources)
    streams = _wanted_streams(sweep, sources, folder)
    for stream in streams:
        output_file(stream.path, sweep.meshes, overwrite=True, new_folder=True)
    journal = Journal(folder, _definition(sweep, sources), overwrite=overwrite)
    (folder / STREAMS).mkdir(exist_ok=True)
    if not journal.goes_on:
        for stream in streams:
            stream.path.unlink(missing_ok=True)
    results.resumed = len(journal.done)
    with _Workers(processes) as workers:
        _make_streams(streams, workers, results, report)
        runs = _runs(sweep, streams)
        batches = _batches(runs, streams, journal, sweep.unprotected)
        total = sum(len(batch.runs) for batch in batches)
        done = 0
        for found in workers.results(do_batch, [(batch,) for batch in batches]):
            done += len(found)
            journal.add(result for result in found if "error" not in result)
            for result in found:
                if "error" in result:
                    place, loss, seed = runs[result["run"]]
                    results.failures[f"{_name(streams[place])}, {loss}, seed {seed}"] = result["error"]
            report(f"{done} of {total} runs", done / total)
    journal.close()
    _collect(results, journal, runs, streams)
    return results


class _Workers:
    """Calls functions in several processes, or in this one."""

    def __init__(self, processes: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(processes, mp_context=context) if processes > 1 else None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def results(self, function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        """What `function` returns for each call, in any order."""
        if self._pool is None:
            for call in calls:
                yield function(*call)
            return
        for future in as_completed([self._pool.submit(function, *call) for call in calls]):
            yield future.result()


def _open_meshes(sweep: Sweep, results: SweepResults) -> list[SweptMesh]:
    sources = []
    for place in sweep.meshes:
        try:
            sources.append(open_mesh(place))
        except (MeshtideError, OSError) as error:
            results.failures[place] = str(error)
    if not sources:
        raise MeshError(f"none of the meshes could be read: {'; '.join(results.failures.values())}")
    return sources


def _definition(sweep: Sweep, sources: Sequence[SweptMesh]) -> dict[str, Any]:
    return {
        "meshes": {source.place: source.digest for source in sources},
        "variants": [repr(variant.options) for variant in sweep.variants],
        "losses": list(sweep.losses),
        "seeds": [sweep.seeds.start, sweep.seeds.stop],
        "unprotected": sweep.unprotected,
    }


def _wanted_streams(sweep: Sweep, sources: Sequence[SweptMesh], folder: Path) -> list[SweptStream]:
    """All streams of the sweep, whether their files are there yet or not."""
    wanted = []
    for place, source in enumerate(sources):
        variants = sweep.variants if source.stream is None else (_variant_of(source.stream),)
        for number, variant in enumerate(variants):
            wanted.append(SweptStream(source, variant, folder / STREAMS / f"{place}-{source.name}-{number}.tide"))
    return wanted


def _make_streams(
    wanted: Sequence[SweptStream], workers: _Workers, results: SweepResults, report: Callable[[str, float], None]
) -> None:
    """Make the files of streams; that of one that cannot be made is missing. Those made before are kept."""
    missing = [stream for stream in wanted if not stream.path.exists()]
    calls = [(index, stream.source, stream.variant, str(stream.path)) for index, stream in enumerate(missing)]
    for done, (index, problem) in enumerate(workers.results(_make_numbered, calls), start=1):
        if problem is not None:
            results.failures[_name(missing[index])] = problem
        report(f"encoded {done} of {len(missing)} streams", done / len(missing))
    if not any(stream.path.exists() for stream in wanted):
        raise MeshError(f"none of the meshes could be encoded: {'; '.join(results.failures.values())}")


def _make_numbered(index: int, source: SweptMesh, variant: Variant, path: str) -> tuple[int, str | None]:
    return index, make_stream(source, variant, path)


def _variant_of(stream: bytes) -> Variant:
    """What a stream that exists is called."""
    header, _, _ = read_available(stream)
    options = header.options
    slices = len(options.slices) if isinstance(options, CompactHeader) else 1
    name = ""
    if isinstance(options, ClassicHeader):
        spec = options.filter
        name = f"degree-{spec.degree}" if spec.kind == "polynomial" else spec.kind
    return Variant(options.profile, name, 0, slices, None)


def _runs(sweep: Sweep, streams: Sequence[SweptStream]) -> list[tuple[int, str, int]]:
    """Every run's stream, link and seed; its place in this list is its number."""
    return [(place, loss, seed) for place in range(len(streams)) for loss in sweep.losses for seed in sweep.seeds]


def _batches(
    runs: Sequence[tuple[int, str, int]], streams: Sequence[SweptStream], journal: Journal, unprotected: str
) -> list[Batch]:
    """The runs that are not done, a few of one stream a batch."""
    batches = []
    for place, stream in enumerate(streams):
        if not stream.path.exists():
            continue
        left = [
            Run(number, loss, seed)
            for number, (other, loss, seed) in enumerate(runs)
            if other == place and number not in journal.done
        ]
        batches += [
            Batch(str(stream.path), tuple(left[start : start + RUNS_A_BATCH]), unprotected)
            for start in range(0, len(left), RUNS_A_BATCH)
        ]
    return batches


def _collect(
    results: SweepResults, journal: Journal, runs: Sequence[tuple[int, str, int]], streams: Sequence[SweptStream]
) -> None:
    for number in sorted(journal.done):
        place, loss, seed = runs[number]
        source, variant = streams[place].source, streams[place].variant
        described = {
            "mesh": source.name,
            "profile": variant.profile,
            "filter": variant.filter,
            "S": variant.variable_from,
            "slices": variant.slices,
            "stream": variant.label,
            "loss": loss,
            "seed": seed,
        }
        results.runs.append(described | journal.done[number]["figures"])
        results.levels += [described | row for row in journal.done[number]["levels"]]


def _name(stream: SweptStream) -> str:
    return f"{stream.source.name}, {stream.variant.label}"
