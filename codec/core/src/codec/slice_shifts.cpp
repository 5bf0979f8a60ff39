#include "codec/slice_shifts.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

void SliceShifts::note(const DiffSlice& slice, const Level& level, int bits, Array<double>& differences) {
    int depth = slice.known_depth();
    DiffSlice::Run run = slice.run_of(level);
    Array<F32x4> known(budget_);
    known.resize(level.vertex_count());
    slice.give_known(level, known.span());
    Array<uint8_t> leaf_depths(budget_);
    Array<double> shifts(budget_);
    size_t old = 0;
    for (size_t v = run.first; v < run.end; v++) {
        if (level.leaves[v] == 0) continue;
        int leaf_depth = level.cell_depths[v];
        leaf_depths.push(level.cell_depths[v]);
        bool was_there = old < leaf_depths_.size() && leaf_depth <= depth_;
        for (size_t k = 0; k < 3; k++) shifts.push(was_there ? shifts_[3 * old + k] : 0.0);
        old += was_there;
        if (leaf_depth >= depth) continue;
        int side = bits - std::max(leaf_depth, depth_); // of the cell that was known before, as a power of two
        for (int k = 0; k < 3; k++) {
            auto after = static_cast<int64_t>(known[v][k]); // in half finest steps
            int64_t before = (2 * (after >> (side + 1)) + 1) << side;
            auto steps = static_cast<double>(static_cast<int64_t>(2) << (bits - depth));
            differences.push(static_cast<double>(after - before) / steps);
        }
    }
    leaf_depths_.swap(leaf_depths);
    shifts_.swap(shifts);
    depth_ = depth;
}

void SliceShifts::replace(int depth, double scale, Span<const double> differences, Span<const double> others) {
    size_t next = 0;
    for (size_t leaf = 0; leaf < leaf_depths_.size(); leaf++) {
        if (leaf_depths_[leaf] >= depth) continue;
        for (size_t k = 0; k < 3; k++, next++) shifts_[3 * leaf + k] += (others[next] - differences[next]) * scale;
    }
}

void SliceShifts::shift(const DiffSlice& slice, const Level& level, int bits, Span<double> positions) const {
    if (leaf_depths_.empty()) return;
    DiffSlice::Run run = slice.run_of(level);
    size_t leaf = 0;
    for (size_t v = run.first; v < run.end; v++) {
        if (level.leaves[v] == 0 || level.cell_depths[v] > depth_) continue;
        while (leaf_depths_[leaf] > level.depth) leaf++; // no leaf yet at this level
        double side = static_cast<double>(1 << (bits - level.cell_depths[v]));
        for (size_t k = 0; k < 3; k++) {
            double shift = shifts_[3 * leaf + k], &position = positions[3 * v + k];
            if (shift == 0) continue;
            double lowest = 0.5 * (static_cast<double>(level.centres[v][static_cast<int>(k)]) - side) - 0.5;
            position = std::clamp(position + shift, lowest, lowest + side);
        }
        leaf++;
    }
}

namespace {

class AllShifts final : public DiffShifts {
public:
    explicit AllShifts(Budget& budget) : budget_(budget), slices_(budget) {}

    void note(size_t number, const DiffSlice& slice, const Level& level, int bits,
              Array<double>& differences) override {
        while (slices_.size() <= number) slices_.add(budget_);
        slices_[number].note(slice, level, bits, differences);
    }
    void replace(size_t number, int depth, double scale, Span<const double> differences,
                 Span<const double> others) override {
        slices_[number].replace(depth, scale, differences, others);
    }
    void shift(size_t number, const DiffSlice& slice, const Level& level, int bits,
               Span<double> positions) const override {
        if (number < slices_.size()) slices_[number].shift(slice, level, bits, positions);
    }

private:
    Budget& budget_;
    List<SliceShifts> slices_;
};

} // namespace

void StreamDecoder::watch_diffs() { shifts_ = std::make_unique<AllShifts>(budget_); }

} // namespace meshtide::inline MESHTIDE_ISA
