#pragma once
#include "base/effort.hpp"
#include "entropy/mixing.hpp"
#include "map/facts.hpp"
#include "map/mirror.hpp"
namespace meshtide::inline MESHTIDE_ISA {
struct MapRoom {
    explicit MapRoom(Budget& budget) : notes(budget), moved(budget), laps(budget), fine_laps(budget), images(budget) {}
    Array<Note> notes;
    Array<F32x4> moved, laps, fine_laps;
    MirrorImages images;
};
template <Effort effort>
struct MapShape { static constexpr int groups = 2, neurons = 3; };
template <Effort effort>
struct MapModel {
    explicit MapModel(Budget& budget) : contexts(budget), weights(budget), final_weights(budget), room(budget) {
        contexts.assign(1, {}); weights.assign(40*4, 0); final_weights.assign(8, 0);
    }
    MixerStates states() { return {contexts.span(), weights.span(), final_weights.span()}; }
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
    MapRoom room;
};
template <class Coder, class Mix, class Facts>
int decide(Coder& coder, const Mix& mixer, const typename Mix::Question& question, const CellFacts& cell, const Facts& facts, uint32_t bit) {
    if constexpr (requires { coder.watch(cell, facts, bit); }) { coder.watch(cell, facts, bit); return bit; }
    else return mixer.code(coder, question, static_cast<int>(bit));
}
MESHTIDE_INLINE uint32_t halvings(float w) {
    auto bits = std::bit_cast<uint32_t>(w);
    return static_cast<uint32_t>(std::clamp(static_cast<int>(bits >> 23) - 127, 0, 15));
}
inline void describe(const Survey& s, CellFacts& f) {
    auto n = static_cast<uint32_t>(s.count), m = static_cast<uint32_t>(s.sum.leaf_count()), k = static_cast<uint32_t>(s.sum.coded_count());
    auto c = static_cast<uint32_t>(s.sum.child_count()), e = static_cast<uint32_t>(s.sum.child_leaf_count()), ages = static_cast<uint32_t>(s.sum.ages());
    f.density = k == 0 ? 6 : std::min((4 * c - 3 * k) / (2 * k), 5u);
    f.ratio = n == 0 ? 5 : 4 * m / n;
    f.coded_ratio = c == 0 ? 5 : std::min(5 * e / c, 4u);
    f.degree = std::min(n, 15u);
    f.age = m == 0 ? 6 : std::min(3 * ages / (2 * m), 5u);
    float w = n == 0 ? 0.0f : s.length / static_cast<float>(n);
    w *= w; w *= w;
    f.spacing = halvings(w);
    if (s.oriented) {
        auto i = std::min(static_cast<uint32_t>(3 * s.normal[1] / s.normal[0]), 2u);
        auto j = std::min(static_cast<uint32_t>(3 * s.normal[2] / s.normal[0]), i);
        f.normal_class = i * (i + 1) / 2 + j;
    } else f.normal_class = 6;
    F32x4 low = F32x4{-1, -1, 1, 1} * splat(s.normal[1]) + F32x4{-1, 1, -1, 1} * splat(s.normal[2]);
    F32x4 base = low - splat(2 * s.offset);
    f.heights[0] = base - splat(s.normal[0]);
    f.heights[1] = base + splat(s.normal[0]);
    f.fit = !s.oriented ? 11 : k == 0 ? 10 : static_cast<uint32_t>(std::min(s.miss / static_cast<float>(k) * 8.0f, 9.0f));
}
template <Effort effort> typename Mixer<MapShape<effort>::groups, MapShape<effort>::neurons, 4>::Question ask_octant(const CellFacts&, const OctantFacts&) { return {}; }
template <Effort effort> typename Mixer<MapShape<effort>::groups, MapShape<effort>::neurons, 4>::Question ask_leaf(const CellFacts&, const LeafFacts&) { return {}; }
}
