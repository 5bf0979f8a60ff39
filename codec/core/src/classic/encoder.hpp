// The payloads of profile classic (docs/format.md, Profile classic), each one range-coded sequence: Base and Map&Conn
// from the coarsest level on, Diffs in any order.
#pragma once

#include "classic/coders.hpp"
#include "classic/connectivity.hpp"

namespace meshtide::inline MESHTIDE_ISA {

class ClassicEncoder {
public:
    ClassicEncoder(Budget& budget, const ClassicFacesModel& trained)
        : budget_(budget), connectivity_(budget, trained), codes_(budget), children_(budget) {}

    // Vertices of the level that was encoded last; 1 before the Base.
    size_t vertex_count() const { return connectivity_.vertex_count(); }

    // Cells of so many bits a coordinate, in Morton order, and their canonical faces.
    void encode_base(Span<const int32_t> cells, int bits, Span<const int32_t> faces, Array<uint8_t>& out) {
        codes_.clear();
        for (size_t v = 0; v < cells.size(); v += 3) {
            uint64_t code = 0;
            for (int i = bits - 1; i >= 0; i--)
                for (size_t k = 0; k < 3; k++) code = code << 1 | (static_cast<uint32_t>(cells[v + k]) >> i & 1);
            codes_.push(code);
        }
        children_.assign(1, static_cast<uint32_t>(codes_.size()));
        RangeEncoder coder(out);
        code_cells(coder, codes_.span(), bits, budget_);
        connectivity_.code_next(coder, children_.span(), faces.size() / 3, faces);
        coder.finish();
    }
    // The vertices of the next level by their parents, which ascend and are all there, and their canonical faces.
    void encode_map_conn(Span<const int32_t> parents, Span<const int32_t> faces, Array<uint8_t>& out) {
        children_.assign(vertex_count(), 0);
        for (int32_t parent : parents) children_[static_cast<size_t>(parent)]++;
        RangeEncoder coder(out);
        code_children(coder, children_.span(), parents.size(), budget_);
        connectivity_.code_next(coder, children_.span(), faces.size() / 3, faces);
        coder.finish();
    }
    void encode_diff(Span<const int32_t> differences, Array<uint8_t>& out) {
        Array<int32_t> copy(budget_);
        copy.copy(differences);
        RangeEncoder coder(out);
        code_differences(coder, copy.span(), budget_);
        coder.finish();
    }

private:
    Budget& budget_;
    ClassicConnectivity connectivity_;
    Array<uint64_t> codes_;
    Array<uint32_t> children_;
};

} // namespace meshtide::inline MESHTIDE_ISA
