#include "surface/display_filter.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr double STRENGTH_UNIT = 128.0;

// Positions x - strength K x, each coordinate clamped to its cell.
void move_within_cells(const KnownCells& cells, const Rings& rings, double strength, Span<const Vector> positions,
                       Span<Vector> moved) {
    for (size_t v = 0; v < positions.size(); v++) {
        size_t first = rings.starts[v], last = rings.starts[v + 1];
        Vector position = positions[v];
        if (last > first && cells.half_sides[v] > 1) {
            Vector total;
            for (size_t i = first; i < last; i++) total = total + positions[static_cast<size_t>(rings.members[i])];
            auto count = static_cast<double>(last - first);
            auto side = static_cast<double>(cells.half_sides[v]);
            auto along = [&](double at, double sum, float middle) {
                double to = at - strength * (at - sum / count), centre = static_cast<double>(middle);
                return std::min(std::max(to, centre - side), centre + side);
            };
            F32x4 middle = cells.middles[v];
            position = {along(position.x, total.x, middle[0]), along(position.y, total.y, middle[1]),
                        along(position.z, total.z, middle[2])};
        }
        moved[v] = position;
    }
}

} // namespace

void draw(const KnownCells& cells, const Rings& rings, Strength strength, Array<Vector>& drawn, Budget& budget) {
    size_t n = cells.middles.size();
    if (rings.vertex_count() != n || cells.half_sides.size() != n)
        fail(Fault::argument, "a level is drawn with the rings of another");
    drawn.resize(n);
    for (size_t v = 0; v < n; v++) {
        F32x4 middle = cells.middles[v];
        drawn[v] = {static_cast<double>(middle[0]), static_cast<double>(middle[1]), static_cast<double>(middle[2])};
    }
    Array<Vector> moved(budget);
    moved.resize(n);
    for (double factor : {strength.smoothing / STRENGTH_UNIT, strength.sharpening / -STRENGTH_UNIT}) {
        if (factor == 0.0) continue;
        move_within_cells(cells, rings, factor, drawn.span(), moved.span());
        drawn.swap(moved);
    }
    for (Vector& v : drawn) v = {0.5 * (v.x - 1.0), 0.5 * (v.y - 1.0), 0.5 * (v.z - 1.0)};
}

} // namespace meshtide::inline MESHTIDE_ISA
