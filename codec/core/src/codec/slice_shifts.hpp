// What changed Diffs do to the vertices of one slice in profile compact: each moves inside its leaf cell, no further.
//
// The Diffs of a packet are how far its bit planes move each leaf's vertex, from the middle of the cell that was known
// to the middle of the smaller one. Others in their place shift the vertex as it is drawn. The contexts of later Diffs
// keep looking at what was sent, so faces and coding stay sound. O(vertices of the slice) a packet.
#pragma once

#include "codec/stream_decoder.hpp"

namespace meshtide::inline MESHTIDE_ISA {

class SliceShifts {
public:
    explicit SliceShifts(Budget& budget) : budget_(budget), leaf_depths_(budget), shifts_(budget) {}

    void note(const DiffSlice& slice, const Level& level, int bits, Array<double>& differences);
    void replace(int depth, double scale, Span<const double> differences, Span<const double> others);
    void shift(const DiffSlice& slice, const Level& level, int bits, Span<double> positions) const;

private:
    Budget& budget_;
    int depth_ = 0;              // that was noted last
    Array<uint8_t> leaf_depths_; // of the leaves in Morton order: those of depth_
    Array<double> shifts_;       // three for each, in finest steps
};

} // namespace meshtide::inline MESHTIDE_ISA
