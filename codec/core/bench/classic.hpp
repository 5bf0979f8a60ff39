// What training needs of profile classic: the levels of a sample as its encoder makes them (docs/format.md, Profile
// classic; codec/meshtide_codec/classic/hierarchy.py), and their faces coded level after level.
#pragma once

#include "classic/connectivity.hpp"
#include "layers.hpp"
#include "surface/triangles.hpp"

#include <algorithm>
#include <array>

namespace meshtide {

struct ClassicSample {
    struct Level {
        std::vector<int32_t> cells, faces;
        std::vector<uint32_t> children; // of each vertex of the coarser level
    };

    explicit ClassicSample(const Sample& sample) {
        Level level{sample.positions, sample.faces, {}};
        int left = sample.bits;
        while (true) {
            size_t n = level.cells.size() / 3;
            int step = 1;
            Level coarse;
            std::vector<int32_t> parents;
            for (; step <= left; step++) {
                coarse = {}, parents.clear();
                for (size_t v = 0; v < n; v++) {
                    std::array<int32_t, 3> cell;
                    for (size_t k = 0; k < 3; k++) cell[k] = level.cells[3 * v + k] >> step;
                    if (coarse.cells.empty() || !std::equal(cell.begin(), cell.end(), coarse.cells.end() - 3)) {
                        coarse.cells.insert(coarse.cells.end(), cell.begin(), cell.end());
                    }
                    parents.push_back(static_cast<int32_t>(coarse.cells.size() / 3) - 1);
                }
                if (2 * n >= coarse.cells.size()) break; // 1.5 times as many vertices
            }
            bool last = n <= MOST_COARSEST || step > left;
            level.children.assign(last ? 1 : coarse.cells.size() / 3, 0);
            if (last)
                level.children[0] = static_cast<uint32_t>(n);
            else
                for (int32_t parent : parents) level.children[static_cast<size_t>(parent)]++;
            if (!last) coarse.faces = faces_above(level.faces, parents);
            levels.insert(levels.begin(), std::move(level));
            if (last) return;
            left -= step;
            level = std::move(coarse);
        }
    }

    std::vector<Level> levels; // coarsest first

private:
    static constexpr size_t MOST_COARSEST = 300;

    static std::vector<int32_t> faces_above(const std::vector<int32_t>& faces, const std::vector<int32_t>& parents) {
        Budget budget(UINT64_MAX);
        Array<int32_t> above(budget);
        for (int32_t corner : faces) above.push(parents[static_cast<size_t>(corner)]);
        canonical_faces(above, static_cast<size_t>(parents.back()) + 1, budget);
        return {above.begin(), above.end()};
    }
};

// All levels in one payload; the connectivity has coded nothing yet. A decoder needs the numbers of children and of
// faces only.
template <class Coder>
void code_classic(Coder& coder, const ClassicSample& sample, ClassicConnectivity& connectivity) {
    for (const ClassicSample::Level& level : sample.levels) {
        Span<const int32_t> truth;
        if (Coder::encoding) truth = {level.faces.data(), level.faces.size()};
        connectivity.code_next(coder, {level.children.data(), level.children.size()}, level.faces.size() / 3, truth);
    }
    coder.finish();
}

} // namespace meshtide
