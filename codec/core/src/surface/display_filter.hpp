// The display filter: what a client draws of a level whose vertices are known up to a cell only (docs/format.md, What
// is drawn).
//
// A vertex is drawn at clamp(y + g K y, cell) with y = clamp(x - f K x, cell), where x is the middle of the cell known
// to hold it and K = I - D^-1 M the random-walk Laplacian of the level's graph: the first step smooths (Balan & Taubin
// 2000, eqs. 1 and 2), the second gives back what the first has shrunk (Taubin, "A signal processing approach to fair
// surface design", SIGGRAPH 1995). So smooth surfaces lose the terraces of the grid and sharp ones leave no cell. Which
// pair of strengths a level has takes four bits; the encoder chooses it by how far the drawn faces are from the true
// surface. O(n + m).
#pragma once

#include "mesh/octree.hpp"
#include "surface/geometry.hpp"
#include "surface/rings.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// How strongly a level is filtered, in units of 1/128: f and g.
struct Strength {
    uint8_t smoothing, sharpening;
};

// Those that a header can name: found one after the other, each the one that brings the levels of eight meshes nearest
// on average.
constexpr size_t STRENGTH_COUNT = 16;
constexpr Strength STRENGTHS[STRENGTH_COUNT] = {{0, 0},   {13, 13}, {26, 26}, {38, 26}, {51, 0},  {64, 26},
                                                {64, 38}, {64, 51}, {64, 64}, {77, 51}, {77, 64}, {96, 0},
                                                {96, 51}, {96, 64}, {115, 0}, {115, 64}};

// Vertices whose cells are known, in half finest steps: middles, and half sides, of which 1 means exactly known.
struct KnownCells {
    Span<const F32x4> middles;
    Span<const int32_t> half_sides;
};

// Where to draw a level's vertices, in finest steps; exactly known ones stay where they are. The same bits everywhere.
void draw(const KnownCells& cells, const Rings& rings, Strength strength, Array<Vector>& drawn, Budget& budget);

// For each depth from `first` on, which of STRENGTHS draws the level, with all Diffs up to it, nearest to the true
// surface. That is, near a vertex, the plane through the mean of the finest vertices in its cell, perpendicular to the
// mean of their normals; a face is as far off as its corners on average, and counts by its area.
void choose_strengths(const Octree& octree, int first, Array<uint8_t>& chosen, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
