// What a walk asks the coarse level: which vertices split, which faces lie at an edge, which of them have an image.
#pragma once

#include "faces/front.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// What a vertex' fan has of the faces at its edges: all of them; all, but it is longer than a search; or not all.
enum class Crowd : uint8_t { plain, wide, crowded };

// crowds: of each vertex.
inline void find_crowds(const Level& level, Span<Crowd> crowds, Budget& budget) {
    size_t faces = level.face_count(), vertices = level.heads.size();
    Span<const int32_t> corners = level.corners.span(), twins = level.twins.span();
    // Of each face: the half-edges that are in the fans of their vertices' heads, as bits.
    Array<uint8_t> reached(budget);
    reached.assign(faces, 0);
    Array<int32_t> seen(budget); // of each vertex: the last one that had an edge to it
    seen.assign(vertices, NONE);
    for (size_t v = 0; v < vertices; v++) {
        int32_t head = level.heads[v], h = head;
        bool twice = false;
        int steps = 0;
        if (head >= 0) do {
                reached[static_cast<size_t>(h) >> 2] |= static_cast<uint8_t>(1 << (h & 3));
                int32_t& last = seen[static_cast<size_t>(corners[static_cast<size_t>(next_half_edge(h))])];
                twice = twice || last == static_cast<int32_t>(v);
                last = static_cast<int32_t>(v);
                steps++;
                h = twins[static_cast<size_t>(previous_half_edge(h))];
            } while (h >= 0 && h != head);
        crowds[v] = twice ? Crowd::crowded : steps > SEARCH_LIMIT ? Crowd::wide : Crowd::plain;
    }
    for (size_t t = 0; t < faces; t++)
        for (uint32_t missed = reached[t] ^ 7u; missed != 0; missed &= missed - 1) // of another fan
            crowds[static_cast<size_t>(corners[4 * t + static_cast<size_t>(std::countr_zero(missed))])] =
                Crowd::crowded;
}

// May edges have several faces a side, or vertices several fans? Then twins do not reach all faces at an edge.
inline bool has_several(const Level& level, Budget& budget) {
    Array<Crowd> crowds(budget);
    crowds.renew(level.heads.size());
    find_crowds(level, crowds.span(), budget);
    return std::find(crowds.begin(), crowds.end(), Crowd::crowded) != crowds.end();
}

struct CoarseMemory {
    explicit CoarseMemory(Budget& budget) : images(budget), crowds(budget), starts(budget), leaving(budget) {}
    // Of each face: 1 if a fine face lies above it, as far as is known, 3 if that is a copy of it.
    Array<uint8_t> images;
    // Only where edges may have several faces a side:
    Array<Crowd> crowds;    // of each vertex
    Array<uint32_t> starts; // of each vertex, in `leaving`
    Array<int32_t> leaving; // half-edges by the vertex where they begin, of those that are not plain

    void give_back() {
        images.give_back();
        crowds.give_back();
        starts.give_back();
        leaving.give_back();
    }
};

class CoarseFaces {
public:
    // several: edges may have more than one face a side, so that twins do not reach all of them.
    CoarseFaces(const Level& level, CoarseMemory& memory, bool several)
        : corners_(level.corners.span()), twins_(level.twins.span()), heads_(level.heads.span()),
          children_(level.first_children.span()), several_(several) {
        memory.images.assign(level.face_count(), 0);
        images_ = memory.images.span();
        if (several) index(level, memory);
    }

    size_t vertex_count() const { return children_.size() - 1; }
    size_t face_count() const { return images_.size(); }
    // May edges that leave p have several faces? If any may, and edges only pass p's fan by.
    MESHTIDE_INLINE bool crowded(int32_t p) const {
        return several_ && crowds_[static_cast<size_t>(p)] == Crowd::crowded;
    }
    bool any_crowded() const { return several_; }

    MESHTIDE_INLINE int32_t first_child(int32_t p) const {
        return static_cast<int32_t>(children_[static_cast<size_t>(p)]);
    }
    MESHTIDE_INLINE int32_t child_count(int32_t p) const { return first_child(p + 1) - first_child(p); }
    MESHTIDE_INLINE bool split(int32_t p) const { return child_count(p) > 1; }
    // Of the face of a half-edge.
    MESHTIDE_INLINE bool covered(int32_t h) const { return images_[static_cast<size_t>(h) >> 2] != 0; }
    MESHTIDE_INLINE void cover(int32_t h) const { images_[static_cast<size_t>(h) >> 2] |= 1; }
    MESHTIDE_INLINE bool copied(int32_t h) const { return images_[static_cast<size_t>(h) >> 2] == 3; }
    MESHTIDE_INLINE void copy(int32_t h) const { images_[static_cast<size_t>(h) >> 2] = 3; }

    MESHTIDE_INLINE int32_t origin(int32_t h) const { return corners_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE int32_t apex(int32_t h) const { return origin(previous_half_edge(h)); }
    MESHTIDE_INLINE int32_t twin(int32_t h) const { return twins_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE int32_t head(int32_t p) const { return heads_[static_cast<size_t>(p)]; }

    // A half-edge p -> q, or NONE.
    int32_t edge(int32_t p, int32_t q) const {
        uint32_t place = 0;
        if (crowded(p)) return next_listed(p, q, place);
        return edge_in_fan(p, q);
    }
    // The half-edges p -> q, one of which is `known` unless that is NONE.
    template <class Visit>
    MESHTIDE_INLINE void each_at(int32_t p, int32_t q, int32_t known, Visit visit) const {
        bool listed = crowded(p) || crowded(q) || (known < 0 && several_);
        uint32_t place = 0;
        int32_t h = listed ? next_listed(p, q, place) : known;
        while (h >= 0) {
            visit(h);
            h = listed ? next_listed(p, q, place) : NONE;
        }
    }
    // The half-edges between p and q, those that leave p first.
    template <class Visit>
    void each_between(int32_t p, int32_t q, Visit visit) const {
        for (int side = 0; side < 2; side++, std::swap(p, q)) each_at(p, q, edge(p, q), visit);
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
            found += !covered(h);
            h = twin(previous_half_edge(h));
        } while (h >= 0 && h != head && ++step < 32);
        return std::min(found, 7);
    }

private:
    int32_t edge_in_fan(int32_t p, int32_t q) const {
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
    // The next half-edge p -> q among those that leave p, from a place in their list on, or NONE.
    int32_t next_listed(int32_t p, int32_t q, uint32_t& place) const {
        auto v = static_cast<size_t>(p);
        if (crowds_[v] == Crowd::plain) return place++ == 0 ? edge_in_fan(p, q) : NONE; // there is one at most
        uint32_t first = starts_[v], last = starts_[v + 1];
        if (last - first > SEARCH_LIMIT) last = first + SEARCH_LIMIT;
        while (first + place < last) {
            int32_t h = leaving_[first + place++];
            if (origin(next_half_edge(h)) == q) return h;
        }
        return NONE;
    }
    void index(const Level& level, CoarseMemory& memory) {
        size_t faces = level.face_count(), vertices = level.heads.size();
        memory.crowds.renew(vertices);
        crowds_ = memory.crowds.span();
        find_crowds(level, memory.crowds.span(), memory.crowds.budget());
        memory.starts.assign(vertices + 1, 0);
        Span<uint32_t> starts = memory.starts.span();
        auto each_leaving = [&](auto visit) { // by their numbers
            for (size_t t = 0; t < faces; t++)
                for (size_t h = 4 * t; h < 4 * t + 3; h++) {
                    auto v = static_cast<size_t>(corners_[h]);
                    if (crowds_[v] != Crowd::plain) visit(v, static_cast<int32_t>(h));
                }
        };
        each_leaving([&](size_t v, int32_t) { starts[v + 1]++; });
        add_up(starts);
        memory.leaving.renew(starts[vertices]);
        Span<int32_t> leaving = memory.leaving.span();
        each_leaving([&](size_t v, int32_t h) { leaving[starts[v]++] = h; });
        for (size_t v = vertices; v > 0; v--) starts[v] = starts[v - 1];
        starts[0] = 0;
        starts_ = starts;
        leaving_ = leaving;
    }

    Span<const int32_t> corners_, twins_, heads_;
    Span<const uint32_t> children_;
    Span<uint8_t> images_;
    Span<const Crowd> crowds_;
    Span<const uint32_t> starts_;
    Span<const int32_t> leaving_;
    bool several_;
};

} // namespace meshtide::inline MESHTIDE_ISA
