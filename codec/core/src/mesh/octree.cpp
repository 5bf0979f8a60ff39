#include "mesh/octree.hpp"

#include "mesh/morton.hpp"

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

void check_positions(Span<const int32_t> positions, int bits) {
    size_t vertices = positions.size() / 3;
    require(vertices > 0 && vertices < 1u << 28, "a mesh on a grid has at least one vertex, and fewer than 2^28");
    for (int32_t coordinate : positions)
        require(coordinate >= 0 && coordinate >> bits == 0, "positions outside of the grid; quantize the mesh first");
}

void check_grid_mesh(Span<const int32_t> positions, Span<const int32_t> faces, int bits) {
    check_positions(positions, bits);
    size_t vertices = positions.size() / 3;
    for (size_t v = 1; v < vertices; v++)
        require(morton_code(&positions[3 * v - 3]) < morton_code(&positions[3 * v]),
                "positions must be pairwise different and in Morton order; weld and sort them first");
    require(faces.size() / 3 < 1u << 28, "a mesh on a grid has fewer than 2^28 faces");
    for (int32_t corner : faces)
        require(corner >= 0 && static_cast<size_t>(corner) < vertices, "a face names a vertex that is not there");
}

Octree::Octree(Span<const int32_t> positions_, Span<const int32_t> faces, int bits_, Budget& budget)
    : bits(bits_), positions(positions_) {
    check_grid_mesh(positions, faces, bits);
    for (size_t t = 0; t < faces.size(); t += 3)
        require(faces[t] != faces[t + 1] && faces[t + 1] != faces[t + 2] && faces[t + 2] != faces[t],
                "a face with two equal corners");
    size_t n = positions.size() / 3;
    // At which depth each vertex and the one before it part: there, and at all greater depths, a cell begins with it.
    Array<uint8_t> parting(budget);
    parting.resize(n);
    size_t beginning[32] = {}; // cells that begin at each depth
    parting[0] = 0;
    beginning[0] = 1;
    int last = 0; // depth at which all cells are leaves
    for (size_t i = 1; i < n; i++) {
        parting[i] = static_cast<uint8_t>(parting_depth(i - 1, i));
        beginning[parting[i]]++;
        last = std::max<int>(last, parting[i]);
    }
    size_t count = 0;
    for (int b = 0; b <= last; b++) {
        Depth& depth = depths.emplace_back(budget);
        count += beginning[b];
        depth.first.reserve(count + 1);
        for (size_t i = 0; i < n; i++)
            if (parting[i] <= b) depth.first.push(static_cast<uint32_t>(i));
        depth.first.push(static_cast<uint32_t>(n));
    }
    // Faces from the finest depth up: those of a depth come from those below, of which ever more fall together.
    Array<Triangle> triangles(budget);
    triangles.resize(faces.size() / 3);
    for (size_t t = 0; t < triangles.size(); t++)
        triangles[t] = rotated(faces[3 * t], faces[3 * t + 1], faces[3 * t + 2]);
    Array<uint32_t> parents(budget);
    for (int b = last; b >= 0; b--) {
        Depth& depth = depths[static_cast<size_t>(b)];
        find_parents(b, parents);
        std::sort(triangles.begin(), triangles.end());
        triangles.resize(static_cast<size_t>(std::unique(triangles.begin(), triangles.end()) - triangles.begin()));
        depth.faces.reserve(3 * triangles.size());
        for (const Triangle& t : triangles) {
            depth.faces.push(t.a);
            depth.faces.push(t.b);
            depth.faces.push(t.c);
        }
        auto parent = [&](int32_t v) { return static_cast<int32_t>(parents[static_cast<size_t>(v)]); };
        size_t kept = 0;
        for (const Triangle& t : triangles) {
            int32_t a = parent(t.a), c = parent(t.b), d = parent(t.c);
            if (a != c && c != d && d != a) triangles[kept++] = rotated(a, c, d);
        }
        triangles.resize(kept);
    }
}

void Octree::find_parents(int b, Array<uint32_t>& parents) const {
    const Depth &depth = at(b), &above = at(std::max(b - 1, 0));
    parents.resize(depth.cell_count());
    for (size_t cell = 0, parent = 0; cell < parents.size(); cell++) {
        parent = above.cell_of(depth.first[cell], parent);
        parents[cell] = static_cast<uint32_t>(parent);
    }
}

int Octree::parting_depth(size_t i, size_t j) const {
    uint32_t differing = 0;
    for (size_t k = 0; k < 3; k++) differing |= static_cast<uint32_t>(positions[3 * i + k] ^ positions[3 * j + k]);
    return bits - (32 - std::countl_zero(differing)) + 1;
}

int Octree::leaf_depth(size_t vertex) const {
    int depth = 0;
    if (vertex > 0) depth = parting_depth(vertex - 1, vertex);
    if (vertex + 1 < positions.size() / 3) depth = std::max(depth, parting_depth(vertex, vertex + 1));
    return depth;
}

void Octree::make_level(int b, Level& level, Budget& budget) const {
    const Depth& depth = at(b);
    size_t n = depth.cell_count();
    level.depth = b;
    level.centres.resize(n);
    level.cell_depths.resize(n);
    level.leaves.resize(n);
    find_parents(b, level.parents);
    level.first_children.clear();
    if (static_cast<size_t>(b) + 1 < depths.size()) {
        const Depth& below = depths[static_cast<size_t>(b) + 1];
        level.first_children.assign(n + 1, 0);
        for (size_t child = 0, parent = 0; child < below.cell_count(); child++) {
            parent = depth.cell_of(below.first[child], parent);
            level.first_children[parent + 1]++;
        }
        for (size_t v = 0; v < n; v++) level.first_children[v + 1] += level.first_children[v];
    }
    for (size_t v = 0; v < n; v++) {
        size_t i = depth.first[v];
        bool leaf = depth.is_leaf(v);
        int cell_depth = leaf ? leaf_depth(i) : b;
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
