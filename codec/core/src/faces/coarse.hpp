// What a walk asks the coarse level: which vertices split, which faces lie at an edge, which of them have an image.
#pragma once

#include "faces/front.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

struct CoarseMemory {
    explicit CoarseMemory(Budget& budget)
        : covered(budget), crowded(budget), starts(budget), leaving(budget), seen(budget) {}
    Array<uint8_t> covered; // of each face: does a fine face lie above it, as far as is known?
    // Only where edges may have several faces a side:
    Array<uint8_t> crowded; // of each vertex: its fan and the twins do not tell all faces at its edges
    Array<uint32_t> starts; // of each vertex, in `leaving`
    Array<int32_t> leaving; // half-edges by the vertex where they begin
    Array<int32_t> seen;    // of each vertex: the last one that had an edge to it
};

class CoarseFaces {
public:
    // several: edges may have more than one face a side, so that twins do not tell all of them.
    CoarseFaces(const Level& level, CoarseMemory& memory, bool several)
        : corners_(level.corners.span()), twins_(level.twins.span()), heads_(level.heads.span()),
          children_(level.first_children.span()), several_(several) {
        memory.covered.assign(level.face_count(), 0);
        covered_ = memory.covered.span();
        if (several) index(level, memory);
    }

    size_t vertex_count() const { return children_.size() - 1; }
    size_t face_count() const { return covered_.size(); }
    // May edges that leave p have several faces? If any may, and edges only pass p's fan by.
    MESHTIDE_INLINE bool crowded(int32_t p) const { return several_ && crowded_[static_cast<size_t>(p)] != 0; }
    bool any_crowded() const { return several_; }

    MESHTIDE_INLINE int32_t first_child(int32_t p) const {
        return static_cast<int32_t>(children_[static_cast<size_t>(p)]);
    }
    MESHTIDE_INLINE int32_t child_count(int32_t p) const { return first_child(p + 1) - first_child(p); }
    MESHTIDE_INLINE bool split(int32_t p) const { return child_count(p) > 1; }
    MESHTIDE_INLINE uint8_t& covered(int32_t h) const { return covered_[static_cast<size_t>(h) >> 2]; }

    MESHTIDE_INLINE int32_t origin(int32_t h) const { return corners_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE int32_t apex(int32_t h) const { return origin(previous_half_edge(h)); }
    MESHTIDE_INLINE int32_t twin(int32_t h) const { return twins_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE int32_t head(int32_t p) const { return heads_[static_cast<size_t>(p)]; }

    // A half-edge p -> q, or NONE.
    int32_t edge(int32_t p, int32_t q) const {
        if (crowded(p)) {
            int32_t found = NONE;
            each_listed(p, q, [&](int32_t h) {
                found = h;
                return false;
            });
            return found;
        }
        int32_t head = heads_[static_cast<size_t>(p)], h = head;
        if (head >= 0) {
            int step = 0;
            do {
                if (origin(next_half_edge(h)) == q) return h;
                h = twin(previous_half_edge(h));
            } while (h >= 0 && h != head && ++step < SEARCH_LIMIT);
        }
        return NONE;
    }
    // The half-edges p -> q, one of which is `known` unless that is NONE.
    template <class Visit>
    MESHTIDE_INLINE void each_at(int32_t p, int32_t q, int32_t known, Visit visit) const {
        if (crowded(p) || crowded(q) || (known < 0 && several_))
            each_listed(p, q, [&](int32_t h) {
                visit(h);
                return true;
            });
        else if (known >= 0)
            visit(known);
    }
    // The vertices around p, some of them twice.
    template <class Visit>
    void each_neighbour(int32_t p, Visit visit) const {
        if (crowded(p)) {
            auto v = static_cast<size_t>(p);
            uint32_t first = starts_[v], last = starts_[v + 1];
            if (last - first > SEARCH_LIMIT) last = first + SEARCH_LIMIT;
            for (uint32_t i = first; i < last; i++) {
                visit(origin(next_half_edge(leaving_[i])));
                visit(apex(leaving_[i]));
            }
            return;
        }
        int32_t head = heads_[static_cast<size_t>(p)], h = head;
        if (head < 0) return;
        int step = 0;
        do {
            visit(origin(next_half_edge(h)));
            int32_t before = previous_half_edge(h);
            h = twin(before);
            if (h < 0) visit(origin(before));
        } while (h >= 0 && h != head && ++step < 32);
    }

    // How many faces around p have no image yet, up to 7.
    int uncovered_around(int32_t p) const {
        int found = 0, step = 0;
        int32_t head = heads_[static_cast<size_t>(p)], h = head;
        if (head < 0) return found;
        do {
            found += covered(h) == 0;
            h = twin(previous_half_edge(h));
        } while (h >= 0 && h != head && ++step < 32);
        return std::min(found, 7);
    }

private:
    template <class Visit>
    MESHTIDE_INLINE void each_listed(int32_t p, int32_t q, Visit visit) const {
        auto v = static_cast<size_t>(p);
        uint32_t first = starts_[v], last = starts_[v + 1];
        if (last - first > SEARCH_LIMIT) last = first + SEARCH_LIMIT;
        for (uint32_t i = first; i < last; i++) {
            int32_t h = leaving_[i];
            if (origin(next_half_edge(h)) == q && !visit(h)) return;
        }
    }
    void index(const Level& level, CoarseMemory& memory) {
        size_t faces = level.face_count(), vertices = level.heads.size();
        memory.starts.assign(vertices + 1, 0);
        Span<uint32_t> starts = memory.starts.span();
        for (size_t v = 0; v < vertices; v++) starts[v + 1] = starts[v] + level.degrees[v];
        memory.leaving.resize(3 * faces);
        Span<int32_t> leaving = memory.leaving.span();
        for (size_t t = 0; t < faces; t++)
            for (size_t h = 4 * t; h < 4 * t + 3; h++)
                leaving[starts[static_cast<size_t>(corners_[h])]++] = static_cast<int32_t>(h);
        for (size_t v = vertices; v > 0; v--) starts[v] = starts[v - 1];
        starts[0] = 0;

        memory.crowded.assign(vertices, 0);
        memory.seen.assign(vertices, NONE);
        for (size_t v = 0; v < vertices; v++) {
            bool crowded = false;
            for (uint32_t i = starts[v]; i < starts[v + 1]; i++) {
                int32_t& seen = memory.seen[static_cast<size_t>(origin(next_half_edge(leaving[i])))];
                crowded = crowded || seen == static_cast<int32_t>(v);
                seen = static_cast<int32_t>(v);
            }
            int32_t head = heads_[v], h = head;
            uint32_t fan = 0;
            if (head >= 0) do {
                    fan++;
                    h = twin(previous_half_edge(h));
                } while (h >= 0 && h != head && fan < level.degrees[v]);
            memory.crowded[v] = crowded || fan != level.degrees[v];
        }
        crowded_ = memory.crowded.span();
        starts_ = starts;
        leaving_ = leaving;
    }

    Span<const int32_t> corners_, twins_, heads_;
    Span<const uint32_t> children_;
    Span<uint8_t> covered_;
    Span<const uint8_t> crowded_;
    Span<const uint32_t> starts_;
    Span<const int32_t> leaving_;
    bool several_;
};

} // namespace meshtide::inline MESHTIDE_ISA
