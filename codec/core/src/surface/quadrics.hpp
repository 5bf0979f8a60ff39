// Quadrics: sums of squared distances to planes, as ten coefficients.
//
// Garland, Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997, sections 4 and 6.1.
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct Quadric {
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, x = 0, y = 0, z = 0, one = 0;

    // The squared distance to a plane through a point, with a normal of length 1.
    void add_plane(Vector through, Vector normal, double weight) {
        double offset = -dot(normal, through);
        xx += weight * normal.x * normal.x, xy += weight * normal.x * normal.y, xz += weight * normal.x * normal.z;
        yy += weight * normal.y * normal.y, yz += weight * normal.y * normal.z, zz += weight * normal.z * normal.z;
        x += weight * normal.x * offset, y += weight * normal.y * offset, z += weight * normal.z * offset;
        one += weight * offset * offset;
    }
    void add(const Quadric& o) {
        xx += o.xx, xy += o.xy, xz += o.xz, yy += o.yy, yz += o.yz, zz += o.zz;
        x += o.x, y += o.y, z += o.z, one += o.one;
    }
    // Total weight of its planes.
    double trace() const { return xx + yy + zz; }
};

struct QuadricMinimum {
    double value;
    Vector place;
};

// Of a quadric and of `pull` > 0 times the squared distance to a place. By LDL^T: the pull makes the matrix positive
// definite, and pivots that rounding takes below it are set to it.
inline QuadricMinimum minimum(const Quadric& q, Vector from, double pull) {
    Vector gradient{q.xx * from.x + q.xy * from.y + q.xz * from.z + q.x,
                    q.xy * from.x + q.yy * from.y + q.yz * from.z + q.y,
                    q.xz * from.x + q.yz * from.y + q.zz * from.z + q.z};
    double value = dot(gradient, from) + q.x * from.x + q.y * from.y + q.z * from.z + q.one;
    auto at_least = [&](double pivot) { return pivot > pull ? pivot : pull; };
    double i1 = 1.0 / (q.xx + pull);
    double l21 = q.xy * i1, l31 = q.xz * i1;
    double i2 = 1.0 / at_least(q.yy + pull - l21 * q.xy);
    double m32 = q.yz - l31 * q.xy, l32 = m32 * i2;
    double i3 = 1.0 / at_least(q.zz + pull - l31 * q.xz - l32 * m32);
    double s1 = -gradient.x, s2 = -gradient.y - l21 * s1, s3 = -gradient.z - l31 * s1 - l32 * s2;
    value -= s1 * s1 * i1 + s2 * s2 * i2 + s3 * s3 * i3;
    double dz = s3 * i3, dy = s2 * i2 - l32 * dz, dx = s1 * i1 - l21 * dy - l31 * dz;
    return {value > 0.0 ? value : 0.0, from + Vector{dx, dy, dz}};
}

} // namespace meshtide::inline MESHTIDE_ISA
