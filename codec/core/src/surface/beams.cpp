#include "surface/beams.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr double WORTH = 4.0;     // a beam pays where the second longest side of the box is so many radii
constexpr double ROUNDING = 1e-9; // of lengths: left of a beam to be sure that no triangle sticks out

Vector across(Vector offset, Vector direction) { return offset - direction * dot(offset, direction); }

} // namespace

double Beam::squared_distance(Vector from) const {
    Vector offset = from - point;
    double distance = length(across(offset, direction)) - radius - ROUNDING * std::abs(dot(offset, direction));
    return distance > 0.0 ? distance * distance : 0.0;
}

Thinness find_beam(const Surface& surface, const BeamRange& range, Beam& beam) {
    size_t face = range.longest / 3, corner = range.longest % 3;
    Vector along = surface.at(face, corner == 2 ? 0 : corner + 1) - surface.at(face, corner);
    const Vector& sides = range.sides;
    double diagonal = length(sides), edge = length(along);
    if (diagonal == 0.0 || diagonal > SPANNED * edge) return Thinness::wide;
    beam.point = surface.at(face, corner);
    beam.direction = along * (1.0 / edge);
    double limit = diagonal / THIN, largest = 0.0;
    for (size_t i = range.first; i < range.end; i++) {
        for (size_t k = 0; k < 3; k++) {
            Vector off = across(surface.at(range.order[i], k) - beam.point, beam.direction);
            largest = std::max(largest, dot(off, off));
        }
        if (largest > limit * limit) return Thinness::wide;
    }
    double radius = std::sqrt(largest);
    beam.radius = radius + ROUNDING * diagonal;
    double middle_side = std::max(std::min(sides.x, sides.y), std::min(std::max(sides.x, sides.y), sides.z));
    return middle_side >= WORTH * radius ? Thinness::worth_a_beam : Thinness::thin;
}

} // namespace meshtide::inline MESHTIDE_ISA
