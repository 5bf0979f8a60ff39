"""The report: one HTML page that reads like section 5, with the published figures beside those found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_lab.paper import page, tables
from meshtide_lab.paper.conclusions import SENTENCES
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from meshtide_lab.paper.published import published

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from meshtide_lab.paper.mesh_result import MeshResult
    from meshtide_lab.paper.run import PaperResults
    from meshtide_lab.paper.tables import Row

TITLE = "Mesh geometry filtering, section 5 run again"
_PARTS = ("coarsest", "coefficients", "differences", "total")
_SCHEME_NAMES = {"multi": "multi-resolution", "single": "single resolution"}
_CAPTIONS = {
    "levels": "Finest and coarsest level (as figs. 1, 5, 9, 13, 17).",
    "predictions": "The finest level without any Diff, predicted from the coarsest by the four filters "
    "(as figs. 2, 6, 10, 14, 18).",
    "rates": "Rate by degree of the least squares filter, power basis (tables 4, 7, 10, 13, 16).",
    "histograms": "Single resolution: semilogarithmic histograms of the Diffs, all coordinates together, with the "
    "power law of eq. (20) fitted by moments (as figs. 3, 7, 11, 15, 19).",
    "errors": "Single resolution: size of each vertex's Diff, divided by the mean of its filter, which is given in "
    "units of the cube (as figs. 4, 8, 12, 16, 20). Lighter is worse.",
}


def report_page(results: PaperResults, pictures: Mapping[str, Mapping[str, bytes]]) -> str:
    """The page.

    Args:
        results: of the experiments.
        pictures: PNG files by mesh and kind: levels, predictions, rates, histograms, errors.
    """
    return page.page(TITLE, _blocks(results, pictures))


def _blocks(results: PaperResults, pictures: Mapping[str, Mapping[str, bytes]]) -> Iterator[str]:
    options = results.options
    yield page.heading(TITLE, 1)
    yield page.paragraph(
        f"Rerun of section 5 of {published().source}. B = {options.bits} bits per coordinate, K = {options.drop_bits}; "
        f"levels that collapse less than {options.minimum_ratio:g} times are skipped, and the hierarchy ends at "
        f"{options.coarsest_vertices} vertices or fewer. Rates are geometry only, in bits per vertex of the finest "
        "level."
    )
    yield page.paragraph(
        "Only the paper's sphere can be made again. Its car, round table, skateboard and piping construction are not "
        "public: the meshes below stand in for them by kind, their figures are not comparable digit by digit, and the "
        "published ones are listed at the end."
    )
    anchors = [(mesh.name, mesh.name) for mesh in results.meshes]
    yield page.contents([("conclusions", "What the paper concludes"), *anchors, ("published", "Published figures")])
    if results.failures:
        yield page.heading("Not analysed", 2)
        yield page.table(["mesh", "reason"], [[name, reason] for name, reason in results.failures.items()])
    yield page.heading("Meshes", 2)
    yield _mesh_table(results.meshes)
    yield page.paragraph(
        "Even meshes have edges of similar length (standard deviation less than half the mean).", note=True
    )
    yield page.heading("What the paper concludes", 2, "conclusions")
    yield _conclusion_table(results.meshes)
    yield page.paragraph(
        "A tick says that the figures of that mesh agree with the sentence. The paper says some of these of certain "
        "meshes only; the figures of each test stand with the mesh.",
        note=True,
    )
    for mesh in results.meshes:
        yield from _mesh_blocks(mesh, pictures[mesh.name])
    yield from _published_blocks()


def _mesh_blocks(mesh: MeshResult, pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield page.heading(mesh.name, 2, mesh.name)
    beside = "published figures beside them" if mesh.published else "the paper does not have this mesh"
    yield page.paragraph(f"{mesh.origin}; {beside}.")
    yield page.figure(pictures["levels"], _CAPTIONS["levels"])
    rates = tables.rate_rows(mesh)
    yield page.heading("Multi-resolution: bytes by filter", 3)
    yield _size_table(mesh, [row for row in rates if row["scheme"] == "multi"], "multi_table")
    yield page.heading("Single resolution (S = number of levels): bytes by filter", 3)
    yield _size_table(mesh, [row for row in rates if row["scheme"] == "single"], "single_table")
    yield page.heading("Rate by degree", 3)
    yield _degree_table(mesh, rates)
    yield page.figure(pictures["rates"], _CAPTIONS["rates"])
    yield page.paragraph(
        "A Diff is coded in cells of its own level's grid. In finest steps, as the last column of the first table "
        "bounds them, a filtered prediction costs more bits at the coarse levels, the zeroth order filter does not.",
        note=True,
    )
    yield page.heading("Predicted without Diffs", 3)
    yield page.figure(pictures["predictions"], _CAPTIONS["predictions"])
    yield _accuracy_table(mesh)
    yield page.heading("Diffs of the single resolution", 3)
    yield _difference_table(mesh)
    yield page.figure(pictures["histograms"], _CAPTIONS["histograms"])
    yield page.figure(pictures["errors"], _CAPTIONS["errors"])
    yield page.heading("Norms (section 4): accuracy, robustness, compression", 3)
    for scheme in ("multi", "single"):
        yield page.paragraph(f"{_SCHEME_NAMES[scheme].capitalize()}, the finest level's Diff lost:")
        yield _norm_table(mesh, scheme)
    yield page.heading("Noise of the Diffs' own size (section 4.2)", 3)
    yield _noise_table(mesh)
    yield page.heading("The paper's sentences on this mesh", 3)
    yield _finding_table(mesh)


def _mesh_table(meshes: Sequence[MeshResult]) -> str:
    rows = [
        [
            row["mesh"],
            str(row["vertices"]),
            str(row["faces"]),
            row["level_vertices"],
            row["level_bits"],
            f"{row['six_neighbours']:.0%}",
            f"{row['edge_variation']:.2f}",
            "yes" if row["even"] else "no",
        ]
        for row in tables.mesh_rows(meshes)
    ]
    columns = (
        "mesh",
        "vertices",
        "faces",
        "vertices of each level",
        "bits",
        "six neighbours",
        "edges' variation",
        "even",
    )
    return page.table(columns, rows)


def _conclusion_table(meshes: Sequence[MeshResult]) -> str:
    columns = ["sentence", "section and test", *(mesh.name for mesh in meshes)]
    rows, classes = [], []
    for sentence in SENTENCES:
        holds = [sentence.find(mesh).holds for mesh in meshes]
        rows.append([f"\u201c{sentence.quote}\u201d", f"{sentence.section}: {sentence.test}", *["" for _ in meshes]])
        classes.append(["text", "text note", *("yes" if each else "no" for each in holds)])
    return page.table(columns, rows, classes)


def _finding_table(mesh: MeshResult) -> str:
    rows, classes = [], []
    for row in tables.conclusion_rows(mesh):
        rows.append([f"\u201c{row['sentence']}\u201d", row["test"], "", row["figures"]])
        classes.append(["text", "text", "yes" if row["holds"] else "no", "text"])
    return page.table(["sentence", "test", "holds", "figures"], rows, classes)


def _size_table(mesh: MeshResult, rows: Sequence[Row], table_field: str) -> str:
    """Bytes by filter as in tables 3, 6, ...; for the paper's mesh each row is followed by the printed one."""
    least = min(row["rate"] for row in rows if row["filter"] in PICTURED_FILTERS)
    cells, classes = [], []
    number = getattr(mesh.published, table_field) if mesh.published else None
    for row in rows:
        if row["filter"] not in PICTURED_FILTERS:
            continue
        bounds = (f"{row['shannon_rate']:.2f}", f"{row['fine_shannon_rate']:.2f}")
        cells.append([row["filter"], *(f"{row[part]}" for part in _PARTS), f"{row['rate']:.2f}", *bounds])
        classes.append(["name", "", "", "", "", "best" if row["rate"] == least else "", "", ""])
        if row["published_total"] is not None:
            printed = [f"{row[f'published_{part}']}" for part in _PARTS]
            cells.append([f"  published, table {number}", *printed, f"{row['published_rate']:.2f}", "", ""])
            classes.append(["name published", *["published"] * 7])
    columns = ("filter", *_PARTS, "bits/vertex", "order-0 bound", "bound in finest steps")
    return page.table(columns, cells, classes)


def _degree_table(mesh: MeshResult, rows: Sequence[Row]) -> str:
    """One row a scheme, one column a degree, and the printed row of the paper's mesh."""
    names = [name for name in mesh.filters if name.startswith("degree ")]
    found = {(row["scheme"], row["filter"]): row for row in rows}
    cells, classes = [], []
    for scheme, title in _SCHEME_NAMES.items():
        rates = [f"{found[scheme, name]['rate']:.2f}" for name in names]
        least = min(rates, key=float)
        cells.append([title, *rates])
        classes.append(["name", *("best" if rate == least else "" for rate in rates)])
    if mesh.published is not None:
        cells.append([f"published, table {mesh.published.degree_table}", *(f"{r:.2f}" for r in mesh.published.degrees)])
        classes.append(["name published", *["published"] * len(names)])
    return page.table(["bits/vertex", *names], cells, classes)


def _accuracy_table(mesh: MeshResult) -> str:
    rows = [row for row in tables.accuracy_rows(mesh) if row["scheme"] == "single"]
    fields = ("mean", "rms", "largest_coordinate", "largest_vertex", "surface_rms", "surface_hausdorff")
    columns = ("x 1e4", "mean |error|", "RMS", "largest, coordinate", "largest, vertex", "surface RMS", "Hausdorff")
    note = "Coordinates and vertices in units of the cube; surfaces as shares of the diagonal."
    cells = [[row["filter"], *(f"{1e4 * row[field]:.2f}" for field in fields)] for row in rows]
    return page.table(columns, cells, _least_marked(cells)) + page.paragraph(note, note=True)


def _difference_table(mesh: MeshResult) -> str:
    columns = ["filter", "l2 error/vertex x 1e4", "alpha", "gap to the power law", "rate by eq. (21)"]
    columns += ["order-0 bound", "coded"]
    cells = []
    for row in tables.difference_rows(mesh):
        figures = [f"{1e4 * row['l2_error']:.2f}", f"{row['alpha']:.2f}", f"{row['gap']:.3f}"]
        figures += [f"{row[rate]:.2f}" for rate in ("modelled_rate", "shannon_rate", "coded_rate")]
        cells.append([row["filter"], *figures])
    classes = [["name", *[""] * 6] for _ in cells]
    if mesh.published is not None:
        columns.insert(2, f"published, table {mesh.published.single_table}")
        for row, shown, kinds in zip(tables.difference_rows(mesh), cells, classes, strict=True):
            printed = row["published_l2_error"]
            shown.insert(2, "" if printed is None else f"{1e4 * printed:.2f}")
            kinds.insert(2, "published")
    return page.table(columns, cells, classes)


def _norm_table(mesh: MeshResult, scheme: str) -> str:
    """The norms, degree by degree; the least of each column and degree is marked."""
    cells, classes = [], []
    rows = [row for row in tables.norm_rows(mesh) if row["scheme"] == scheme]
    for degree in sorted({row["degree"] for row in rows}):
        block = [
            [
                f"degree {degree}, {row['norm']}",
                *(f"{1e4 * row[name]:.2f}" for name in ("mean", "rms", "largest_coordinate", "largest_vertex")),
                *(f"{row[name]:.2f}" for name in ("rate", "shannon_rate")),
            ]
            for row in rows
            if row["degree"] == degree
        ]
        cells += block
        classes += _least_marked(block)
    columns = (
        "fit",
        "mean |error| (l1) x 1e4",
        "RMS (l2) x 1e4",
        "largest coordinate (l-infinity) x 1e4",
        "largest vertex x 1e4",
        "bits/vertex",
        "order-0 bound",
    )
    return page.table(columns, cells, classes)


def _noise_table(mesh: MeshResult) -> str:
    """One row a filter: noise and error, level by level from coarse to fine."""
    cells: dict[str, list[str]] = {}
    levels = []
    for row in reversed(tables.noise_rows(mesh)):
        sizes = (f"{1e4 * row[kind]:.1f}" for kind in ("injected_rms", "reconstructed_rms"))
        cells.setdefault(row["filter"], [row["filter"]]).append(" \u2192 ".join(sizes))
        levels.append(f"level {row['level']}")
    note = (
        "Multi-resolution, Gaussian noise on every Diff. Each cell: root mean square of the noise that the level's "
        "Diff got, and of the level's error after decoding, in units of the cube x 1e4."
    )
    rows = [cells[name] for name in mesh.noises if name in cells]
    return page.table(["filter", *dict.fromkeys(levels)], rows) + page.paragraph(note, note=True)


def _least_marked(cells: Sequence[Sequence[str]]) -> list[list[str]]:
    """Classes of the cells: all that show the least number of their column are marked; the first column holds names."""
    columns = list(zip(*cells, strict=True))[1:]
    marked = [["best" if cell == min(column, key=float) else "" for cell in column] for column in columns]
    return [["name", *row] for row in zip(*marked, strict=True)]


def _published_blocks() -> Iterator[str]:
    document = published()
    yield page.heading("Published figures", 2, "published")
    yield page.paragraph(f"{document.source}.")
    for mesh in document.meshes.values():
        faces = "" if mesh.faces is None else f", {mesh.faces} faces"
        yield page.heading(mesh.name, 3)
        yield page.paragraph(
            f"{mesh.description}; {mesh.vertices} vertices{faces}, {mesh.levels} levels, coarsest "
            f"{mesh.coarsest_vertices} vertices (tables {mesh.multi_table}, {mesh.degree_table}, {mesh.single_table}; "
            f"errors in {mesh.l2_unit:g})."
        )
        cells = [
            [
                name,
                *(str(getattr(mesh.multi[name], part)) for part in _PARTS),
                f"{mesh.multi[name].rate:.2f}",
                str(mesh.single[name].total),
                f"{mesh.single[name].rate:.2f}",
                f"{mesh.single[name].l2_error}",
            ]
            for name in PICTURED_FILTERS
        ]
        columns = ("filter", *_PARTS, "bits/vertex", "single: total", "single: bits/vertex", "single: l2 error/vertex")
        yield page.table(columns, cells)
        degrees = [f"degree {degree}" for degree in range(1, len(mesh.degrees) + 1)]
        yield page.table(["bits/vertex", *degrees], [["multi-resolution", *(f"{rate:.2f}" for rate in mesh.degrees)]])
    yield page.paragraph(" ".join(document.remarks), note=True)
