// The fine mesh in the making: its faces so far, and the gates, the half-edges where others may follow.
//
// Faces keep the slots that they have in the coarse level; the others take what is free, so that most of a level is
// copied, not made. The gates of a vertex are lists through a pool of records: the open front stays in the cache.
#pragma once

#include "mesh/level.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Half-edge `from` -> `to` of a face; the face that is asked for runs back, so `to` is its first corner.
struct Gate {
    int32_t half_edge, from, to;
    int32_t ahead;                                        // the coarse half-edge whose face lies there, or NONE
    int32_t next_out, previous_out, next_in, previous_in; // lists of gates that leave `from`, and that reach `to`
};

constexpr int32_t UNTOUCHED = -2; // in VertexState::out: a vertex without faces
constexpr int SEARCH_LIMIT = 64;  // steps of a search around a vertex or an edge

// All that a walk knows of a vertex, in one line of the cache. The first half is never written to in a walk, so that
// loads of vectors do not wait for stores of parts.
struct VertexState {
    F32x4 row;       // position, in cells of the fine depth, and the parent as the bits of the fourth lane
    int32_t out, in; // the newest gates that leave it, and that reach it; NONE, or UNTOUCHED
    int32_t degree;
    uint32_t split : 2; // 1: its cell has several children; 2: a gate at it was found to have no face
    uint32_t mark : 30; // the last gate that it is no apex for
};

// The angle of a cosine, in half turns; M. Abramowitz and I. Stegun, "Handbook of Mathematical Functions", 4.4.45.
MESHTIDE_ONCE F32x4 arc(F32x4 cosine) {
    F32x4 x = least(magnitude(cosine), splat(1.0f));
    F32x4 angle = square_root(splat(1.0f) - x) *
                  (splat(0.4999787f) + x * (splat(-0.0675181f) + x * (splat(0.0236380f) - x * splat(0.0059617f))));
    I32x4 negative = cosine < splat(0.0f);
    return reinterpret_cast<F32x4>((reinterpret_cast<I32x4>(angle) & ~negative) |
                                   (reinterpret_cast<I32x4>(splat(1.0f) - angle) & negative));
}

struct FrontMemory {
    explicit FrontMemory(Budget& budget) : vertices(budget), angles(budget), gates(budget), free_slots(budget) {}
    Array<VertexState> vertices;
    Array<float> angles; // of each vertex: the sum of its faces' angles there; high only
    Array<Gate> gates;
    Array<int32_t> free_slots;
    uint32_t serial = 0;

    void give_back() {
        vertices.give_back();
        angles.give_back();
        gates.give_back();
        free_slots.give_back();
    }
};

class Front {
public:
    Front(Level& level, FrontMemory& memory) : level_(level), memory_(memory) {}

    // Room for so many faces, none there.
    void start(size_t faces, size_t slots) {
        level_.corners.resize(4 * slots);
        level_.twins.resize(4 * slots);
        corners_ = level_.corners.span();
        twins_ = level_.twins.span();
        vertices_ = memory_.vertices.span();
        level_.heads.assign(level_.parents.size(), NONE);
        heads_ = level_.heads.span();
        memory_.gates.clear();
        memory_.free_slots.clear();
        free_gate_ = NONE;
        face_limit_ = faces;
        face_count_ = slot_count_ = 0;
    }

    size_t face_count() const { return face_count_; }
    bool full() const { return face_count_ == face_limit_; }
    size_t slot_count() const { return slot_count_; }
    bool is_face(size_t slot) const { return corners_[4 * slot + 3] >= 0; }
    size_t vertex_count() const { return vertices_.size(); }

    MESHTIDE_INLINE VertexState& vertex(int32_t v) const { return vertices_[static_cast<size_t>(v)]; }
    MESHTIDE_INLINE int32_t parent(int32_t v) const { return reinterpret_cast<I32x4>(row(v))[3]; }
    MESHTIDE_INLINE F32x4 position(int32_t v) const { return __builtin_shufflevector(row(v), splat(0), 0, 1, 2, 4); }
    MESHTIDE_INLINE F32x4 row(int32_t v) const { return vertex(v).row; }
    MESHTIDE_INLINE const VertexState* states(int32_t v, int32_t count) const {
        return vertices_.block(static_cast<size_t>(v), static_cast<size_t>(count));
    }
    // One that no vertex is marked with, but for those that were more than 2^30 marks ago.
    MESHTIDE_INLINE uint32_t next_serial() const { return memory_.serial = (memory_.serial + 1) & 0x3fffffff; }
    MESHTIDE_INLINE float angle(int32_t v) const { return memory_.angles[static_cast<size_t>(v)]; }
    // Adds a face's angles to those of its corners.
    void add_angles(int32_t a, int32_t b, int32_t c) const {
        F32x4 p = position(a), q = position(b), r = position(c);
        F32x4 pq = q - p, qr = r - q, rp = p - r;
        float g = dot3(pq, pq), j = dot3(qr, qr), i = dot3(rp, rp);
        F32x4 cosines = F32x4{g + i - j, g + j - i, i + j - g, 0} * splat(0.5f) /
                        square_root(F32x4{g * i, g * j, i * j, 1} + splat(1e-20f));
        F32x4 angles = arc(cosines);
        memory_.angles[static_cast<size_t>(a)] += angles[0];
        memory_.angles[static_cast<size_t>(b)] += angles[1];
        memory_.angles[static_cast<size_t>(c)] += angles[2];
    }
    MESHTIDE_INLINE int32_t& corner(int32_t h) const { return corners_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE int32_t& twin(int32_t h) const { return twins_[static_cast<size_t>(h)]; }
    MESHTIDE_INLINE Gate& gate(int32_t k) const { return memory_.gates[static_cast<size_t>(k)]; }

    // The gate at a half-edge, or NONE. While a mesh is made, twins below NONE name gates.
    MESHTIDE_INLINE int32_t gate_at(int32_t h) const {
        int32_t twin = twins_[static_cast<size_t>(h)];
        return twin < NONE ? -2 - twin : NONE;
    }

    MESHTIDE_ONCE int32_t open(int32_t h, int32_t from, int32_t to, int32_t ahead) {
        int32_t k = free_gate_;
        if (k >= 0) {
            free_gate_ = gate(k).next_out;
        } else {
            k = static_cast<int32_t>(memory_.gates.size());
            memory_.gates.push({});
        }
        int32_t out = vertex(from).out, in = vertex(to).in;
        out = out < 0 ? NONE : out;
        gate(k) = {h, from, to, ahead, out, NONE, in, NONE};
        if (out >= 0) gate(out).previous_out = k;
        if (in >= 0) gate(in).previous_in = k;
        vertex(from).out = vertex(to).in = k;
        twin(h) = -2 - k;
        return k;
    }
    MESHTIDE_ONCE void close(int32_t k) {
        Gate& closed = gate(k);
        if (closed.previous_out >= 0)
            gate(closed.previous_out).next_out = closed.next_out;
        else
            vertex(closed.from).out = closed.next_out;
        if (closed.next_out >= 0) gate(closed.next_out).previous_out = closed.previous_out;
        if (closed.previous_in >= 0)
            gate(closed.previous_in).next_in = closed.next_in;
        else
            vertex(closed.to).in = closed.next_in;
        if (closed.next_in >= 0) gate(closed.next_in).previous_in = closed.previous_in;
        closed.next_out = free_gate_;
        free_gate_ = k;
    }
    // The newest gate that runs from here to there, among as many as a search may see.
    MESHTIDE_ONCE int32_t find_gate(int32_t from, int32_t to) const {
        int32_t k = vertex(from).out;
        for (int step = 0; k >= 0 && step < SEARCH_LIMIT; step++) {
            const Gate& found = gate(k);
            if (found.to == to) return k;
            k = found.next_out;
        }
        return NONE;
    }
    MESHTIDE_ONCE void join(int32_t h, int32_t k) {
        int32_t other = gate(k).half_edge;
        close(k);
        twin(h) = other;
        twin(other) = h;
    }

    // A slot for one more face, with its corners.
    MESHTIDE_ONCE int32_t add(int32_t a, int32_t b, int32_t c) {
        expect(face_count_ < face_limit_, "more faces than were announced");
        int32_t slot;
        if (!memory_.free_slots.empty())
            slot = memory_.free_slots.pop();
        else
            slot = static_cast<int32_t>(slot_count_++);
        face_count_++;
        store(corners_.block(4 * static_cast<size_t>(slot), 4), I32x4{a, b, c, 0});
        touch(a, 4 * slot);
        touch(b, 4 * slot + 1);
        touch(c, 4 * slot + 2);
        return slot;
    }

    // The faces of the coarse level without split corners, in their slots and with their twins. The
    // gates are left to the caller, who gets each half-edge with which a copied face begins.
    template <class Copied>
    void copy(const Level& coarse, Copied copied) {
        size_t slots = coarse.face_count();
        Span<const int32_t> corners = coarse.corners.span();
        Span<const uint32_t> children = coarse.first_children.span();
        for (size_t t = slots; t-- > 0;) { // free slots are taken from the end, so the first one goes first
            const int32_t* from = corners.block(4 * t, 4);
            int32_t fine[3];
            bool split = false;
            for (int k = 0; k < 3; k++) {
                auto p = static_cast<size_t>(from[k]);
                fine[k] = static_cast<int32_t>(children[p]);
                split = split || children[p + 1] - children[p] > 1;
            }
            if (split) {
                memory_.free_slots.push(static_cast<int32_t>(t));
                store(corners_.block(4 * t, 4), I32x4{0, 0, 0, -1});
                continue;
            }
            expect(face_count_ < face_limit_, "more faces than were announced");
            face_count_++;
            copied(4 * static_cast<int32_t>(t));
            store(corners_.block(4 * t, 4), I32x4{fine[0], fine[1], fine[2], 0});
            for (int k = 0; k < 3; k++) touch(fine[k], 4 * static_cast<int32_t>(t) + k);
        }
        slot_count_ = slots;
        if (slots != 0) std::memcpy(twins_.block(0, 4 * slots), coarse.twins.begin(), 16 * slots);
    }

    // Fills the slots that are still free with the last faces, and sets heads. No gate may be left.
    void finish() {
        for (int32_t slot : memory_.free_slots) {
            auto hole = static_cast<size_t>(slot);
            while (slot_count_ > 0 && !is_face(slot_count_ - 1)) slot_count_--;
            if (slot_count_ <= face_count_) break;
            if (hole >= face_count_) continue;
            move(--slot_count_, hole);
        }
        level_.corners.resize(4 * face_count_);
        level_.twins.resize(4 * face_count_);
        for (size_t t = 0; t < face_count_; t++)
            for (size_t h = 4 * t; h < 4 * t + 3; h++)
                if (twins_[h] < 0) {
                    twins_[h] = NONE;
                    heads_[static_cast<size_t>(corners_[h])] = static_cast<int32_t>(h);
                }
    }

private:
    MESHTIDE_INLINE void touch(int32_t v, int32_t h) {
        VertexState& state = vertex(v);
        state.degree++;
        state.out = state.out == UNTOUCHED ? NONE : state.out;
        heads_[static_cast<size_t>(v)] = h;
    }
    void move(size_t from, size_t to) {
        store(corners_.block(4 * to, 4), load<I32x4>(corners_.block(4 * from, 4)));
        for (size_t k = 0; k < 3; k++) {
            int32_t twin = twins_[4 * from + k];
            auto h = static_cast<int32_t>(4 * to + k);
            if (twin >= 0 && static_cast<size_t>(twin) / 4 == from)
                twin = static_cast<int32_t>(4 * to) + (twin & 3); // of a face that meets itself
            twins_[4 * to + k] = twin;
            if (twin >= 0) twins_[static_cast<size_t>(twin)] = h;
            heads_[static_cast<size_t>(corners_[4 * to + k])] = h;
        }
        corners_[4 * from + 3] = -1;
    }

    Level& level_;
    FrontMemory& memory_;
    Span<int32_t> corners_, twins_, heads_;
    Span<VertexState> vertices_;
    int32_t free_gate_ = NONE;
    size_t face_limit_ = 0, face_count_ = 0, slot_count_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
