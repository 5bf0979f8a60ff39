// Where vertices of classic levels stand (docs/format.md, Profile classic), in finest steps: cell c of a level that
// dropped s bits has its middle at (c + 1/2) 2^s - 1/2, so that at level 0 it is the grid point itself.
#pragma once

#include "surface/geometry.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

struct ClassicGrid {
    int bits;  // B
    int shift; // bits that the level has dropped

    double side() const { return static_cast<double>(1 << shift); }
    double middle(double cell) const { return (cell + 0.5) * side() - 0.5; }
    // Onto the border of the cube, from outside of it: no true vertex lies there.
    double within(double x) const { return std::clamp(x, -0.5, static_cast<double>(1 << bits) - 0.5); }
    // The cell that holds a coordinate inside of the cube.
    double cell_of(double x) const {
        return std::min(std::floor((x + 0.5) / side()), static_cast<double>((1 << (bits - shift)) - 1));
    }

    Vector within(Vector v) const { return {within(v.x), within(v.y), within(v.z)}; }
    Vector moved(Vector prediction, const double* differences) const {
        return {middle(cell_of(prediction.x) + differences[0]), middle(cell_of(prediction.y) + differences[1]),
                middle(cell_of(prediction.z) + differences[2])};
    }
};

} // namespace meshtide::inline MESHTIDE_ISA
