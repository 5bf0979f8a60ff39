"""Draw the house from its imports: packages, their floors, their rooms, and which room uses which.

    python tools/draw_house.py            # writes docs/house.svg
    python tools/draw_house.py --check    # ends with 1 if that picture is old, or something goes round in a circle

A room is a folder; modules that stand beside the rooms are drawn smaller. A floor is what may import the floors below,
by the contracts in pyproject.toml for the Python packages, by the longest way down for the core, whose arrows are its
#includes. The core's arrows are drawn; those of Python would cover the picture, so they are counted, and held against
the floors by `lint-imports`.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections import defaultdict
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "house.svg"
PACKAGES = {
    "meshtide_lab": "client/meshtide_lab: the laboratory",
    "meshtide_client": "client/meshtide_client",
    "meshtide_server": "server/meshtide_server",
    "meshtide_codec": "codec/meshtide_codec",
}
CORE = "codec/core/src: the core, C++"

WIDTH, GAP, ROW, PAD = 1080, 8, 30, 12
TITLE = 26
LABEL = 'aria-label="The packages of meshtide, their floors and rooms"'
STYLE = """
  text { font: 12px ui-sans-serif, system-ui, sans-serif; fill: #1b2733; }
  .title { font-weight: 600; font-size: 13px; }
  .count { fill: #5a6b7b; }
  .frame { fill: #f4f7fa; stroke: #b8c6d3; }
  .room { fill: #cfe3f5; stroke: #5b8db8; }
  .module { fill: #ffffff; stroke: #b8c6d3; }
  .arrow { stroke: #5a6b7b; fill: none; marker-end: url(#head); }
  .head { fill: #5a6b7b; }
  @media (prefers-color-scheme: dark) {
    text { fill: #e4ebf1; }
    .count { fill: #9fb0bf; }
    .frame { fill: #17212b; stroke: #3c4d5d; }
    .room { fill: #234561; stroke: #6fa3d0; }
    .module { fill: #1f2b37; stroke: #3c4d5d; }
    .arrow { stroke: #9fb0bf; }
    .head { fill: #9fb0bf; }
  }
"""


@dataclass
class Package:
    """One package of the house.

    Args:
        title: shown above it.
        floors: what stands on each, the highest first.
        rooms: those of them that are folders.
        arrows: which of them imports which.
    """

    title: str
    floors: list[list[str]]
    rooms: set[str]
    arrows: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))

    @property
    def arrow_count(self) -> int:
        """How many pairs there are of which one imports the other."""
        return sum(map(len, self.arrows.values()))


def house() -> tuple[dict[str, Package], dict[str, set[str]]]:
    """The packages, the core last, and which package imports which."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    packages = {name: _package(name, graph) for name in PACKAGES}
    between: dict[str, set[str]] = defaultdict(set)
    for name in PACKAGES:
        for module in {name, *graph.find_descendants(name)}:
            between[name] |= {found.split(".")[0] for found in graph.find_modules_directly_imported_by(module)} - {name}
    packages["core"] = _core()
    between["meshtide_codec"].add("core")
    return packages, between


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """What is reached from itself, each circle once."""
    reached = {name: _below(name, arrows) for name in arrows}
    found = {tuple(sorted(other for other in reached[name] if name in reached.get(other, ()))) for name in arrows}
    return [list(circle) for circle in sorted(found) if circle]


def _below(name: str, arrows: dict[str, set[str]]) -> set[str]:
    found: set[str] = set()
    waiting = list(arrows.get(name, ()))
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting += arrows.get(one, ())
    return found


def _package(name: str, graph: grimp.ImportGraph) -> Package:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    floors = next(each["layers"] for each in contracts if each.get("containers") == [name])
    rooms = {child.split(".")[1] for child in graph.find_children(name) if graph.find_children(child)}
    package = Package(PACKAGES[name], [re.split(r" [|:] ", floor) for floor in floors], rooms)
    for module in graph.find_descendants(name):
        here = module.split(".")[1]
        for imported in graph.find_modules_directly_imported_by(module):
            if imported.startswith(f"{name}.") and (there := imported.split(".")[1]) != here:
                package.arrows[here].add(there)
    return package


def _core() -> Package:
    rooms = {folder.name for folder in (ROOT / "codec/core/src").iterdir() if folder.is_dir()}
    arrows: dict[str, set[str]] = {room: set() for room in rooms}
    for path in sorted((ROOT / "codec/core/src").glob("*/*.?pp")):
        here = path.parent.name
        included = set(re.findall(r'^#include "(\w+)/', path.read_text(), re.MULTILINE))
        arrows[here] |= (included & rooms) - {here}

    def depth(room: str, above: frozenset[str] = frozenset()) -> int:
        return 1 + max((depth(one, above | {room}) for one in arrows[room] - above), default=-1)

    depths = {room: depth(room) for room in rooms}
    floors = [sorted(room for room in rooms if depths[room] == floor) for floor in range(max(depths.values()), -1, -1)]
    return Package(CORE, floors, rooms, arrows)


class _Drawing:
    """The picture while it is drawn, from its top down."""

    def __init__(self) -> None:
        self.shapes: list[str] = []
        self.frames: dict[str, tuple[float, float, float, float]] = {}

    def package(self, name: str, package: Package, left: float, top: float, width: float) -> float:
        """Draw a package; returns where its frame ends."""
        places: dict[str, tuple[float, float, float]] = {}
        drawn_arrows = name == "core"
        step = ROW + (26 if drawn_arrows else GAP)
        y = top + TITLE + PAD / 2
        boxes = []
        for floor in package.floors:
            x = left + PAD
            for one in sorted(floor, key=lambda one: (one not in package.rooms, one)):
                wide = 7.0 * len(one) + 18
                if x + wide > left + width - PAD:
                    x, y = left + PAD, y + ROW
                kind = "room" if one in package.rooms else "module"
                boxes.append(f'<rect class="{kind}" x="{x:.0f}" y="{y:.0f}" width="{wide:.0f}" height="22" rx="4"/>')
                boxes.append(f'<text x="{x + wide / 2:.0f}" y="{y + 15:.0f}" text-anchor="middle">{escape(one)}</text>')
                places[one] = (x + wide / 2, y, y + 22)
                x += wide + (90 if drawn_arrows else GAP)
            y += step
        bottom = y - step + ROW + PAD / 2
        self.frames[name] = (left, top, left + width, bottom)
        frame = f'<rect class="frame" x="{left}" y="{top:.0f}" width="{width}" height="{bottom - top:.0f}" rx="8"/>'
        counts = f"{len(package.rooms)} rooms, {len(package.floors)} floors, {package.arrow_count} arrows"
        title = f'<text class="title" x="{left + PAD}" y="{top + 19:.0f}">{escape(package.title)}'
        self.shapes += [frame, f'{title}<tspan class="count" dx="10" font-weight="400">{counts}</tspan></text>']
        if drawn_arrows:
            for above, others in sorted(package.arrows.items()):
                nearest = others - {far for one in others for far in _below(one, package.arrows)}
                for below in sorted(nearest):
                    (x1, _, y1), (x2, y2, _) = places[above], places[below]
                    middle = (y1 + y2) / 2
                    path = f"M{x1:.0f},{y1:.0f} C{x1:.0f},{middle:.0f} {x2:.0f},{middle:.0f} {x2:.0f},{y2 - 5:.0f}"
                    self.shapes.append(f'<path class="arrow" d="{path}"/>')
        self.shapes += boxes
        return bottom

    def arrow(self, above: str, below: str, at: float) -> None:
        """An arrow from the lower edge of one package to the upper edge of another."""
        start, end = self.frames[above][3], self.frames[below][1]
        self.shapes.append(f'<path class="arrow" d="M{at:.0f},{start:.0f} L{at:.0f},{end - 5:.0f}"/>')


def picture(packages: dict[str, Package]) -> str:
    """The picture as SVG."""
    drawing = _Drawing()
    half, space = (WIDTH - 24) / 2, 28
    end = drawing.package("meshtide_lab", packages["meshtide_lab"], 0, 0, half)
    client = drawing.package("meshtide_client", packages["meshtide_client"], 0, end + space, half)
    server = drawing.package("meshtide_server", packages["meshtide_server"], half + 24, 0, half)
    codec = drawing.package("meshtide_codec", packages["meshtide_codec"], 0, max(client, server) + space, WIDTH)
    bottom = drawing.package("core", packages["core"], 0, codec + space, WIDTH)
    drawing.arrow("meshtide_lab", "meshtide_client", half / 2)
    drawing.arrow("meshtide_client", "meshtide_codec", half / 2)
    drawing.arrow("meshtide_server", "meshtide_codec", half * 1.5 + 24)
    drawing.arrow("meshtide_codec", "core", WIDTH / 2)
    head = '<marker id="head" viewBox="0 0 8 8" refX="4" refY="4" markerWidth="6" markerHeight="6" orient="auto">'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-1 -1 {WIDTH + 2} {bottom + 2:.0f}" role="img" {LABEL}>',
            f"<style>{STYLE}</style>",
            f'<defs>{head}<path class="head" d="M0,0 L8,4 L0,8 z"/></marker></defs>',
            *drawing.shapes,
            "</svg>",
            "",
        ]
    )


def main() -> int:
    """The command; the exit code says whether all is well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; fail where the picture is old")
    check = parser.parse_args().check
    packages, between = house()
    found = [circle for arrows in (between, *(each.arrows for each in packages.values())) for circle in circles(arrows)]
    for package in packages.values():
        rooms, floors = len(package.rooms), len(package.floors)
        print(f"{package.title}: {rooms} rooms, {floors} floors, {package.arrow_count} arrows")
    print(f"circles: {len(found)}", *(" <-> ".join(circle) for circle in found), sep="\n  ")
    drawn = picture(packages)
    old = check and (not PICTURE.exists() or PICTURE.read_text() != drawn)
    if old:
        print(f"{PICTURE.relative_to(ROOT)} is old: run python tools/draw_house.py", file=sys.stderr)
    elif not check:
        PICTURE.write_text(drawn)
    return 1 if found or old else 0


if __name__ == "__main__":
    sys.exit(main())
