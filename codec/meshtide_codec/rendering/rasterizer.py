"""A shaded picture of a mesh, drawn by the processor alone: no screen, no graphics card, no driver.

A renderer of one's own, because the libraries that draw meshes need more than pip can install where there is no
screen: VTK, Open3D, pyrender and moderngl draw through a library of the system (EGL, OSMesa or X), and VTK with what
it needs takes 700 MB. What reports need is small: parallel projection, hidden surfaces, one light, colours at the
vertices. `raster` draws 70 000 triangles in a fraction of a second, and the same bits everywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError
from meshtide_codec.rendering import raster

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.rendering.lettering import Image
    from meshtide_codec.rendering.view import Framing

LARGEST_SIZE = 4096
OVERSAMPLING = 2
PAPER = np.array([250, 249, 246], np.uint8)
SURFACE = (122.0, 166.0, 190.0)
_BRIGHTEST = 1.18
"""What a surface that faces the light has of its colour; colours end at white."""
_LIGHT = raster.Light(np.array([0.4, 0.5, 0.77]) / np.linalg.norm([0.4, 0.5, 0.77]), ambient=0.3)
_EDGE = np.array([50.0, 54.0, 60.0])
_EDGE_WIDTH = 0.9
_DOT_RADIUS = 1.5


def render(
    mesh: Mesh,
    frame: Framing,
    size: int,
    *,
    colours: NDArray[np.float64] | None = None,
    smooth: bool = False,
    edges: bool = False,
) -> Image:
    """A picture of `mesh`; where it has no faces, of its vertices as dots.

    Args:
        mesh: what to draw.
        frame: from where, and in which scale.
        size: width and height in pixels, 1 to 4096.
        colours: (n, 3) float64 of the vertices, 0 to 255, blended across faces; None for one colour.
        smooth: whether normals are blended across faces, too, or each face is flat.
        edges: whether to draw the edges of the faces.

    Returns:
        (size, size, 3) uint8.

    Raises:
        OptionError: the size is out of range, or there is not a colour for each vertex.
    """
    if not 1 <= size <= LARGEST_SIZE:
        raise OptionError(f"a picture is 1 to {LARGEST_SIZE} pixels wide, not {size}")
    if colours is None:
        colours = np.broadcast_to(np.array(SURFACE), mesh.vertices.shape)
    if colours.shape != mesh.vertices.shape:
        raise OptionError(f"{len(mesh.vertices)} vertices need colours (n, 3), not {colours.shape}")
    colours = np.ascontiguousarray(colours, np.float64)
    fine = size * OVERSAMPLING
    points = frame.pixels(mesh.vertices, fine)
    image = np.empty((fine, fine, 3))
    image[:] = PAPER
    buffers = raster.PixelBuffers.empty(fine, fine)
    if len(mesh.faces):
        raster.draw_faces(points, mesh.faces, buffers)
        normals = raster.vertex_normals(points, mesh.faces) if smooth else None
        pen = raster.Pen(_EDGE_WIDTH * OVERSAMPLING if edges else 0.0, _EDGE)
        shown, shades = raster.shade(
            points, mesh.faces, buffers, normals=normals, colours=colours * _BRIGHTEST, light=_LIGHT, pen=pen
        )
        image[shown] = shades
    else:
        raster.draw_dots(points, colours, _DOT_RADIUS * OVERSAMPLING, buffers.depths, image)
    blocks = np.minimum(image, 255.0).reshape(size, OVERSAMPLING, size, OVERSAMPLING, 3)
    coarse: Image = np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)
    return coarse
