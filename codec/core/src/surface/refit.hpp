// Refit of a simplified mesh: its vertices move until its surface is as close as it can be to the original's.
//
// Gauss-Newton on the symmetric distance of the surfaces: points spread evenly over each are projected on the other;
// each pair gives a plane, and the vertices take the least squares of the distances to the planes, held by weak
// springs. These are the iterated closest points of Chen and Medioni, "Object modelling by registration of multiple
// range images", Image and Vision Computing 10 (1992), for the vertices of a mesh instead of a rigid motion.
//
// The equations are summed up in a matrix of 9 x 9 for each face, since all of a row's unknowns are corners of one
// face: passes over the system then cost O(faces), not O(samples).
#pragma once

#include "surface/closest_points.hpp"
#include "surface/triangles.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Symmetric 3 x 3.
struct Symmetric {
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;

    void add(const Symmetric& o, double factor) {
        xx += factor * o.xx, xy += factor * o.xy, xz += factor * o.xz;
        yy += factor * o.yy, yz += factor * o.yz, zz += factor * o.zz;
    }
    Vector operator*(Vector v) const {
        return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z};
    }
};

// The planes whose feet lie on one face, as a quadratic form of its three corners: block (i, j) moves the gradient at
// corner i by what corner j moves.
struct FacePlanes {
    Symmetric blocks[6]; // 00 11 22 01 12 20
    static size_t block(size_t i, size_t j) { return i == j ? i : i + j == 1 ? 3 : i + j == 3 ? 4 : 5; }
};

// Fits the vertices of one simplified mesh to an original surface, both in the same unit, grid steps.
class Refitter {
public:
    // `faces`, at least one, and the original must stay as they are; `vertices` is how many the faces use.
    Refitter(const ClosestPoints& original, Span<const int32_t> faces, size_t vertices, Budget& budget);

    // The vertices after some rounds of projection and least squares.
    void fit(Span<Vector> vertices);

    // The points of a grid, `step` apart from 0 to `last`, that put the surface closest to the original. A vertex may
    // go to any point of the grid that is near: along the surface it costs little to move, and some point is always
    // close to the surface. That is worth most of a bit per coordinate.
    void round(Span<const Vector> vertices, double step, int32_t last, Array<int32_t>& grid);

    // Root mean square distance of the surfaces, of the worse direction.
    double distance(Span<const Vector> vertices);

private:
    void project(Span<const Vector> vertices, size_t stride);
    static size_t hint(const Array<Foot>& feet, size_t place, size_t stride);
    void add_plane(const Foot& foot, Span<const Vector> vertices, Vector direction, Vector through);
    void multiply(Span<const Vector> values, Span<Vector> products) const;
    void solve(Span<Vector> vertices);
    size_t round_once(Span<const Vector> wanted, double step, int32_t last, Span<int32_t> grid);
    Vector direction(Vector difference, const Surface& surface, const Foot& foot) const;

    const ClosestPoints& original_;
    Span<const int32_t> faces_;
    Budget& budget_;
    double full_stiffness_, stiffness_; // of springs, with all samples, and with those that are in use
    Array<Vector> samples_;             // of the original
    Array<Foot> feet_; // of those, on the mesh, when it was searched last: there the next search begins
    Array<Foot> own_;  // samples of the mesh, by face and weights
    Array<Foot> back_; // of those, on the original
    Array<FacePlanes> planes_;
    Array<Vector> gradient_;           // of half the sum of squares, at the vertices of the last projection
    Array<uint32_t> starts_, corners_; // of each vertex: its corners, 3 face + corner
};

} // namespace meshtide::inline MESHTIDE_ISA
