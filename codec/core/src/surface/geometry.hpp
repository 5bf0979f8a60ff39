// Points of space in doubles, and surfaces made of triangles.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

#include <cmath>

namespace meshtide::inline MESHTIDE_ISA {

struct Vector {
    double x = 0, y = 0, z = 0;

    Vector operator+(Vector o) const { return {x + o.x, y + o.y, z + o.z}; }
    Vector operator-(Vector o) const { return {x - o.x, y - o.y, z - o.z}; }
    Vector operator*(double factor) const { return {x * factor, y * factor, z * factor}; }
};
inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(Vector a, Vector b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(Vector a) { return std::sqrt(dot(a, a)); }

// Triangles, which may meet in any way; `faces` names three vertices for each, in range.
struct Surface {
    Span<const Vector> vertices;
    Span<const int32_t> faces;

    size_t face_count() const { return faces.size() / 3; }
    int32_t corner(size_t face, size_t k) const { return faces[3 * face + k]; }
    Vector at(size_t face, size_t k) const { return vertices[static_cast<size_t>(corner(face, k))]; }
    // As long as twice the face's area.
    Vector normal(size_t face) const {
        Vector a = at(face, 0);
        return cross(at(face, 1) - a, at(face, 2) - a);
    }
};

// A point of a surface: on which face, and the weights of its second and third corner.
struct Foot {
    int32_t face = -1;
    double second = 0, third = 0;

    double weight(size_t corner) const {
        double first = 1.0 - second - third;
        return corner == 1 ? second : corner == 2 ? third : first > 0.0 ? first : 0.0;
    }
    Vector on(const Surface& surface) const {
        auto f = static_cast<size_t>(face);
        return surface.at(f, 0) * weight(0) + surface.at(f, 1) * second + surface.at(f, 2) * third;
    }
};

} // namespace meshtide::inline MESHTIDE_ISA
