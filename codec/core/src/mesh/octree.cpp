#include "mesh/octree.hpp"

#include <algorithm>
#include <cmath>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

struct Triangle {
    int32_t a, b, c;
    bool operator==(const Triangle&) const = default;
    bool operator<(const Triangle& other) const {
        return a != other.a ? a < other.a : b != other.b ? b < other.b : c < other.c;
    }
};

// Rotated so that the least corner comes first.
Triangle rotated(int32_t a, int32_t b, int32_t c) {
    if (b < a && b < c) return {b, c, a};
    if (c < a && c < b) return {c, a, b};
    return {a, b, c};
}

} // namespace

Octree::Octree(Span<const int32_t> positions_, Span<const int32_t> faces, int bits_, Budget& budget)
    : bits(bits_), positions(positions_) {
    size_t n = positions.size() / 3;
    auto same_cell = [&](size_t i, size_t j, int shift) {
        for (size_t k = 0; k < 3; k++)
            if (positions[3 * i + k] >> shift != positions[3 * j + k] >> shift) return false;
        return true;
    };
    for (int b = 0; b <= bits; b++) depths.emplace_back(budget);
    Array<uint32_t> cells(budget), above(budget); // of each finest vertex, at this depth and at the one above
    cells.resize(n);
    above.assign(n, 0);
    for (int b = 0; b <= bits; b++) {
        Depth& depth = depths[static_cast<size_t>(b)];
        for (size_t i = 0; i < n; i++) {
            if (i == 0 || !same_cell(i, i - 1, bits - b)) {
                depth.first.push(static_cast<uint32_t>(i));
                depth.parents.push(above[i]);
            }
            cells[i] = static_cast<uint32_t>(depth.first.size() - 1);
        }
        depth.first.push(static_cast<uint32_t>(n));
        above.swap(cells);
    }
    // Faces from the finest depth up: those of a depth come from those below, of which ever more fall together.
    std::vector<Triangle> triangles;
    for (size_t t = 0; t < faces.size() / 3; t++)
        triangles.push_back(rotated(faces[3 * t], faces[3 * t + 1], faces[3 * t + 2]));
    for (int b = bits; b >= 0; b--) {
        Depth& depth = depths[static_cast<size_t>(b)];
        std::sort(triangles.begin(), triangles.end());
        triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
        for (const Triangle& t : triangles) {
            depth.faces.push(t.a);
            depth.faces.push(t.b);
            depth.faces.push(t.c);
        }
        auto parent = [&](int32_t v) { return static_cast<int32_t>(depth.parents[static_cast<size_t>(v)]); };
        size_t kept = 0;
        for (const Triangle& t : triangles) {
            int32_t a = parent(t.a), c = parent(t.b), d = parent(t.c);
            if (a != c && c != d && d != a) triangles[kept++] = rotated(a, c, d);
        }
        triangles.resize(kept);
    }
}

void Octree::make_level(int b, Level& level, Budget& budget) const {
    const Depth& depth = depths[static_cast<size_t>(b)];
    size_t n = depth.cell_count();
    level.depth = b;
    level.centres.resize(n);
    level.cell_depths.resize(n);
    level.leaves.resize(n);
    level.parents.copy(depth.parents.span());
    level.first_children.clear();
    if (b < bits) {
        const Depth& below = depths[static_cast<size_t>(b) + 1];
        level.first_children.assign(n + 1, 0);
        for (uint32_t parent : below.parents) level.first_children[parent + 1]++;
        for (size_t v = 0; v < n; v++) level.first_children[v + 1] += level.first_children[v];
    }
    for (size_t v = 0; v < n; v++) {
        size_t i = depth.first[v];
        int cell_depth = b;
        bool leaf = depth.is_leaf(v);
        if (leaf) { // the first depth at which its cell holds it alone
            cell_depth = 0;
            auto shared = [&](size_t j) {
                uint32_t differing = 0;
                for (size_t k = 0; k < 3; k++)
                    differing |= static_cast<uint32_t>(positions[3 * i + k] ^ positions[3 * j + k]);
                return bits - (32 - std::countl_zero(differing)) + 1; // the depth that parts them
            };
            if (i > 0) cell_depth = std::max(cell_depth, shared(i - 1));
            if (i + 1 < positions.size() / 3) cell_depth = std::max(cell_depth, shared(i + 1));
        }
        level.leaves[v] = leaf;
        level.cell_depths[v] = static_cast<uint8_t>(cell_depth);
        int shift = bits - cell_depth;
        F32x4 centre = {0, 0, 0, 0};
        for (size_t k = 0; k < 3; k++) {
            int32_t cell = positions[3 * i + k] >> shift;
            centre[k] = static_cast<float>((2 * cell + 1) << shift);
        }
        level.centres[v] = centre;
    }
    size_t faces = depth.faces.size() / 3;
    level.corners.assign(4 * faces, 0);
    for (size_t t = 0; t < faces; t++)
        for (size_t k = 0; k < 3; k++) level.corners[4 * t + k] = depth.faces[3 * t + k];
    link(level, budget);
}

} // namespace meshtide::inline MESHTIDE_ISA
