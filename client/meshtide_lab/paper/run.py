"""Runs the experiments of section 5 on several meshes, over several processes, and lists what failed.

Each filter and each norm on each mesh is a task of its own; results do not depend on how many processes share the work.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from meshtide_codec.errors import MeshtideError
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.quantize import quantize
from meshtide_codec.samples import load_sample, sample_names
from meshtide_codec.sphere import PAPER_FILTERS, paper_sphere
from meshtide_lab.paper.experiment import FilterResult, run_filter
from meshtide_lab.paper.like_meshes import LIKE_MESHES
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS, MeshResult, new_mesh_result
from meshtide_lab.paper.noise_experiment import NoiseResult, run_noise
from meshtide_lab.paper.norm_experiment import NORM_DEGREES, NORMS, run_norm
from meshtide_lab.paper.published import SPHERE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.quantize import QuantizedMesh
    from meshtide_lab.paper.norm_experiment import NormResult

DEFAULT_MESHES = (SPHERE, *LIKE_MESHES, *sample_names())


_Outcome: TypeAlias = "FilterResult | NoiseResult | list[NormResult] | MeshtideError"


@dataclass(frozen=True, slots=True)
class PaperResults:
    """What was found.

    Args:
        options: of the hierarchy.
        meshes: results in the order of the arguments.
        failures: why a mesh is missing, by its name.
    """

    options: ClassicOptions
    meshes: list[MeshResult]
    failures: dict[str, str]


@dataclass(frozen=True, slots=True)
class _Task:
    """A filter of section 5 or, where a degree is given, a norm of section 4, or a filter with noise, on one mesh."""

    mesh: str
    name: str
    degree: int | None = None
    noise: bool = False


def run_paper(
    inputs: Sequence[str],
    options: ClassicOptions,
    *,
    processes: int = 1,
    progress: Callable[[str, float], None] | None = None,
) -> PaperResults:
    """Run all experiments.

    Args:
        inputs: ``sphere``, names in `LIKE_MESHES`, samples, or mesh files.
        options: of the hierarchy; their filter is not looked at.
        processes: how many share the work; 1 for this one alone.
        progress: is called with a stage and the fraction done.

    Raises:
        MeshtideError: a process was ended from outside.
    """
    report = progress or (lambda _stage, _fraction: None)
    meshes: dict[str, MeshResult] = {}
    failures: dict[str, str] = {}
    for text in inputs:
        report(f"read {text}", 0.0)
        try:
            name, origin, mesh = named_mesh(text, [*meshes, *failures])
            meshes[name] = new_mesh_result(name, origin, quantize(mesh, options.bits), options)
        except (MeshtideError, OSError) as error:
            failures[text] = str(error)
    tasks = [task for name in meshes for task in _tasks(name)]
    for done, (task, outcome) in enumerate(_outcomes(tasks, meshes, options, processes)):
        report(f"{task.mesh}, {task.name}", done / len(tasks))
        if isinstance(outcome, MeshtideError):
            failures.setdefault(task.mesh, f"{task.name}: {outcome}")
        elif isinstance(outcome, FilterResult):
            meshes[task.mesh].filters[task.name] = outcome
        elif isinstance(outcome, NoiseResult):
            meshes[task.mesh].noises[task.name] = outcome
        else:
            meshes[task.mesh].norms.extend(outcome)
    whole = [_ordered(result) for name, result in meshes.items() if name not in failures]
    return PaperResults(options, whole, failures)


def named_mesh(text: str, taken: Sequence[str]) -> tuple[str, str, Mesh]:
    """The mesh that an argument means, a name of its own, and where it comes from.

    Raises:
        MeshError, OSError: it is a file that holds no mesh.
    """
    path = Path(text)
    if text == SPHERE:
        origin, mesh = "the paper's sphere, made again", paper_sphere()
    elif text in LIKE_MESHES:
        origin, mesh = "made by rule, of like kind as the paper's", LIKE_MESHES[text]()
    elif text in sample_names() and not path.exists():
        origin, mesh = "a sample mesh that comes with meshtide", load_sample(text)
    else:
        origin, mesh = path.name, load_mesh(path)
    stem = mesh_name(text)
    name, count = stem, 1
    while name in taken:
        count += 1
        name = f"{stem}-{count}"
    return name, origin, mesh


def mesh_name(text: str) -> str:
    """What the files of the mesh that an argument means are called, where no other mesh has that name.

    >>> mesh_name("scans/fandisk.obj"), mesh_name("sphere"), mesh_name("sphere.ply")
    ('fandisk', 'sphere', 'sphere-file')
    """
    stem = Path(text).stem
    return "sphere-file" if stem == SPHERE and text != SPHERE else stem  # a file of that name is not the paper's


def _tasks(mesh: str) -> list[_Task]:
    filters = [_Task(mesh, name) for name in PAPER_FILTERS]
    noises = [_Task(mesh, name, noise=True) for name in PICTURED_FILTERS]
    return filters + noises + [_Task(mesh, norm, degree) for degree in NORM_DEGREES for norm in NORMS]


def _outcomes(
    tasks: Sequence[_Task], meshes: dict[str, MeshResult], options: ClassicOptions, processes: int
) -> Iterator[tuple[_Task, _Outcome]]:
    """Each task and what came of it, as they end."""
    if processes == 1:
        for task in tasks:
            yield task, _work(task, meshes[task.mesh].quantized, options)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        waiting = {pool.submit(_work, task, meshes[task.mesh].quantized, options): task for task in tasks}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenProcessPool as error:
            raise MeshtideError(
                "a process that shared the work ended before its time, most likely for lack of memory; "
                "try fewer --processes, or fewer meshes"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _work(task: _Task, quantized: QuantizedMesh, options: ClassicOptions) -> _Outcome:
    try:
        if task.degree is not None:
            return run_norm(quantized, options, task.degree, task.name)
        if task.noise:
            return run_noise(quantized, options, task.name, PAPER_FILTERS[task.name])
        keep = task.name in PICTURED_FILTERS
        return run_filter(quantized, options, task.name, PAPER_FILTERS[task.name], keep_arrays=keep)
    except MeshtideError as error:
        return error


def _ordered(result: MeshResult) -> MeshResult:
    """The same result, whatever the order in which its tasks ended."""
    filters = {name: result.filters[name] for name in PAPER_FILTERS}
    result.filters.clear()
    result.filters.update(filters)
    noises = {name: result.noises[name] for name in PICTURED_FILTERS}
    result.noises.clear()
    result.noises.update(noises)
    result.norms.sort(key=lambda found: (found.scheme, found.degree, list(NORMS).index(found.norm)))
    return result
