// Surfaces for tests: spheres, fans of slivers, sheets, triangles at random.
#pragma once

#include "check.hpp"
#include "mesh/morton.hpp"
#include "surface/sorting.hpp"
#include "surface/triangles.hpp"

#include <map>
#include <utility>

namespace meshtide::testing {

inline double unit_number(Numbers& numbers) { return static_cast<double>(numbers.below(1u << 30)) / (1u << 30); }

inline void add_face(TriangleMesh& mesh, int32_t a, int32_t b, int32_t c) {
    mesh.faces.push(a), mesh.faces.push(b), mesh.faces.push(c);
}

// An octahedron whose faces are split into four so many times, of radius 1 about
// the origin: 4^(splits + 1) + 2 vertices.
inline void make_sphere(int splits, TriangleMesh& mesh) {
    for (double sign : {1.0, -1.0})
        for (int k = 0; k < 3; k++) mesh.vertices.push({k == 0 ? sign : 0.0, k == 1 ? sign : 0.0, k == 2 ? sign : 0.0});
    for (int octant = 0; octant < 8; octant++) {
        int32_t a = octant & 1 ? 3 : 0, b = octant & 2 ? 4 : 1, c = octant & 4 ? 5 : 2;
        bool turned = ((octant & 1) + (octant >> 1 & 1) + (octant >> 2 & 1)) % 2 != 0;
        add_face(mesh, a, turned ? c : b, turned ? b : c);
    }
    for (int split = 0; split < splits; split++) {
        std::map<std::pair<int32_t, int32_t>, int32_t> middles;
        auto middle = [&](int32_t a, int32_t b) {
            auto [found, is_new] = middles.try_emplace({std::min(a, b), std::max(a, b)}, mesh.vertices.size());
            if (is_new) {
                Vector sum = mesh.vertices[static_cast<size_t>(a)] + mesh.vertices[static_cast<size_t>(b)];
                mesh.vertices.push(sum * (1.0 / length(sum)));
            }
            return found->second;
        };
        size_t corners = mesh.faces.size();
        for (size_t t = 0; t < corners; t += 3) {
            int32_t a = mesh.faces[t], b = mesh.faces[t + 1], c = mesh.faces[t + 2];
            int32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            mesh.faces[t + 1] = ab, mesh.faces[t + 2] = ca;
            add_face(mesh, ab, b, bc), add_face(mesh, ca, bc, c), add_face(mesh, ab, bc, ca);
        }
    }
}

// So many slivers around one vertex, which stands `height` above the circle of the others.
inline void make_fan(int count, double height, TriangleMesh& mesh) {
    mesh.vertices.push({0, 0, height});
    for (int i = 0; i < count; i++) {
        double turn = 2 * 3.14159265358979 * i / count;
        mesh.vertices.push({std::cos(turn), std::sin(turn), 0});
        add_face(mesh, 0, 1 + i, 1 + (i + 1) % count);
    }
}

// side x side vertices, one step apart in x and y.
inline void make_sheet(int32_t side, TriangleMesh& mesh) {
    auto first = static_cast<int32_t>(mesh.vertices.size());
    for (int32_t i = 0; i < side * side; i++)
        mesh.vertices.push({static_cast<double>(i / side), static_cast<double>(i % side), 0});
    for (int32_t i = 0; i + 1 < side; i++) {
        for (int32_t j = 0; j + 1 < side; j++) {
            int32_t at = first + i * side + j;
            add_face(mesh, at, at + side, at + 1), add_face(mesh, at + 1, at + side, at + side + 1);
        }
    }
}

// A mesh on a grid, as encoders take it.
struct QuantizedMesh {
    explicit QuantizedMesh(Budget& budget) : positions(budget), faces(budget) {}
    Array<int32_t> positions, faces;
    size_t vertex_count() const { return positions.size() / 3; }
};

// On a grid of so many bits, over the box from `low` of sides `side`; vertices that meet become one.
inline void quantize(const TriangleMesh& mesh, int bits, Vector low, double side, QuantizedMesh& quantized,
                     Budget& budget) {
    Array<Keyed> keys(budget);
    Array<int32_t> grid(budget), owners(budget);
    double steps = (1 << bits) - 1;
    for (size_t v = 0; v < mesh.vertices.size(); v++) {
        Vector at = (mesh.vertices[v] - low) * (steps / side);
        uint32_t cell[3] = {static_cast<uint32_t>(at.x + 0.5), static_cast<uint32_t>(at.y + 0.5),
                            static_cast<uint32_t>(at.z + 0.5)};
        for (uint32_t x : cell) grid.push(static_cast<int32_t>(x));
        keys.push({meshtide::morton_code(cell[0], cell[1], cell[2]), static_cast<uint32_t>(v)});
    }
    sort_keyed(keys, 3 * bits, budget);
    owners.resize(keys.size());
    for (size_t i = 0; i < keys.size(); i++) {
        if (i == 0 || keys[i].key != keys[i - 1].key)
            for (size_t k = 0; k < 3; k++) quantized.positions.push(grid[3 * keys[i].place + k]);
        owners[keys[i].place] = static_cast<int32_t>(quantized.vertex_count() - 1);
    }
    for (int32_t v : mesh.faces) quantized.faces.push(owners[static_cast<size_t>(v)]);
    canonical_faces(quantized.faces, quantized.vertex_count(), budget);
}

} // namespace meshtide::testing
