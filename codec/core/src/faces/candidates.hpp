// The candidates for the apex of a new face, and what each of them is worth.
//
// Candidates come as ranges of vertices, the children of coarse vertices, and are looked at four at a time. Each gets a
// score, a sum of trained numbers at places that its properties choose (a log-linear model, in 256ths of a doubling),
// and a weight, two to the power of the score. The scores go on learning: softmax regression, one step a choice.
#pragma once

#include "base/effort.hpp"
#include "faces/coarse.hpp"
#include "faces/front.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

constexpr int BLOCK_LIMIT = 24;
constexpr int LANE_LIMIT = 4 * BLOCK_LIMIT;

// Where a candidate comes from.
enum Kind {
    AHEAD = 0,     // a child of the apex of the coarse face that lies ahead
    COVERED = 1,   // the same, but the coarse face has an image already
    SIBLING = 2,   // another child of the parents of the gate's ends
    WITHIN = 3,    // another child of the parent, at a gate inside of one cell
    AROUND = 4,    // a child of a cell around that
};
constexpr int KINDS = 5;
// A candidate's corner: 8 kind + [it has faces] + 2 [it closes the edge at `first`] + 4 [at `second`].
constexpr int CORNERS = 8 * KINDS;

// Places of the scores.
template <Effort effort, bool positions>
struct ScorePlaces;

template <>
struct ScorePlaces<Effort::standard, true> {
    static constexpr int SHAPE = 0;                       // 256 corner + 16 bend + angle
    static constexpr int LENGTHS = SHAPE + 256 * CORNERS; // 64 longer + 4 shorter + kind
    static constexpr int ENDS = LENGTHS + 1024;           // 16 lesser + difference, for each closing
    static constexpr int VALENCE = ENDS + 4 * 128;        // 16 corner + faces
    static constexpr int APART = VALENCE + 16 * CORNERS;  // 16 corner + distance from a parallelogram
    static constexpr int COUNT = APART + 16 * CORNERS;
    static constexpr int TERMS = 5;
};
template <>
struct ScorePlaces<Effort::high, true> : ScorePlaces<Effort::standard, true> {};
template <>
struct ScorePlaces<Effort::standard, false> {
    static constexpr int SHAPE = 0; // corner
    static constexpr int ENDS = SHAPE + CORNERS;
    static constexpr int VALENCE = ENDS + 4 * 128;
    static constexpr int COUNT = VALENCE + 16 * CORNERS;
    static constexpr int TERMS = 3;
};
template <>
struct ScorePlaces<Effort::high, false> : ScorePlaces<Effort::standard, false> {};

constexpr int NO_SCORE = -100000000;
constexpr float SCORE_LIMIT = 14000;

// Two to the power of a score in 256ths, linear between powers: the bits of a float are nearly its logarithm.
MESHTIDE_INLINE F32x4 power(I32x4 score) {
    return reinterpret_cast<F32x4>((score << 15) + splat32(127 << 23));
}
// The other way round.
MESHTIDE_INLINE int logarithm(float x) { return (std::bit_cast<int32_t>(x) - (127 << 23)) >> 15; }

template <Effort effort, bool positions>
class Candidates {
public:
    using Places = ScorePlaces<effort, positions>;
    static constexpr int TERMS = Places::TERMS;

    int32_t first, second, known;                // of the gate: the new face begins with first, second
    int32_t closing_first, closing_second;       // the vertices that would close the edges at its ends, or NONE
    int lanes = 0, count = 0;                    // lanes in use; candidates in them
    float total = 0;                             // of the weights
    int32_t vertex_of[LANE_LIMIT];
    int32_t corner_of[LANE_LIMIT];
    int32_t score_of[LANE_LIMIT];                // NO_SCORE: there is no candidate in this lane
    float weight_of[LANE_LIMIT];
    int32_t places_of[TERMS][LANE_LIMIT];
    static constexpr int FAN_LIMIT = 8;
    int32_t blocked[2 * FAN_LIMIT + 1];
    int blocked_count = 0;

    Candidates(const Front& front, Span<int16_t> scores) : front_(front), scores_(scores) {}

    // half_edge: of the face behind, second -> first; `known` is its apex.
    void aim(int32_t half_edge, int32_t first_, int32_t second_) {
        first = first_, second = second_, known = front_.corner(previous_half_edge(half_edge));
        block_fans(half_edge);
        const VertexState &a = front_.vertex(first), &b = front_.vertex(second);
        closing_first = a.out >= 0 ? front_.gate(a.out).to : NONE;
        closing_second = b.in >= 0 ? front_.gate(b.in).from : NONE;
        lanes = count = 0;
        totals_ = splat(0);
        int u = std::min(a.degree, 7), v = std::min(b.degree, 7), least = std::min(u, v), apart = std::abs(u - v);
        ends_[0] = Places::ENDS + 16 * least + apart;
        ends_[1] = Places::ENDS + 128 + 16 * u + v;
        ends_[2] = Places::ENDS + 256 + 16 * v + u;
        ends_[3] = Places::ENDS + 384 + 16 * least + apart;
        if constexpr (positions) {
            F32x4 p = front_.position(first), q = front_.position(second), r = front_.position(known);
            F32x4 side = q - p, normal = cross3(p - q, r - q), across = cross3(normal, side), far = p + q - r;
            spread(p, px_, py_, pz_);
            spread(q, qx_, qy_, qz_);
            spread(across, ax_, ay_, az_);
            spread(far, fx_, fy_, fz_);
            float length = dot3(side, side);
            length_ = splat(length);
            scale_ = splat(length > 0 ? 1.0f / length : 0.0f);
            normal_length_ = splat(dot3(normal, normal));
        }
    }

    // Vertices base, base + 1, ...: at most four. all: also those whose edges are all taken.
    template <bool all>
    MESHTIDE_INLINE void add_block(int32_t base, int32_t size, int kind) {
        if (lanes == LANE_LIMIT) return;
        const VertexState* states = front_.four_states(base);
        I32x4 out = {states[0].out, states[1].out, states[2].out, states[3].out};
        I32x4 degree = {states[0].degree, states[1].degree, states[2].degree, states[3].degree};
        I32x4 lane = {0, 1, 2, 3}, vertex = lane + splat32(base);
        I32x4 valid = (lane < splat32(size)) & (vertex != splat32(first)) & (vertex != splat32(second));
        if (!all) {
            valid &= out != splat32(NONE);
            for (int i = 0; i < blocked_count; i++) valid &= vertex != splat32(blocked[i]);
        }
        I32x4 touched = all ? out != splat32(UNTOUCHED) : out >= splat32(0);
        I32x4 closes1 = (vertex == splat32(closing_first)) & touched;
        I32x4 closes2 = (vertex == splat32(closing_second)) & touched;
        // Comparisons are -1.
        I32x4 corner = splat32(8 * kind) - touched - 2 * closes1 - 4 * closes2;
        I32x4 both = closes1 & closes2;
        I32x4 ends = splat32(ends_[0]) + (closes1 & splat32(ends_[1] - ends_[0])) +
                     (closes2 & splat32(ends_[2] - ends_[0])) +
                     (both & splat32(ends_[3] - ends_[2] - ends_[1] + ends_[0]));
        I32x4 places[TERMS];
        I32x4 many = degree > splat32(15);
        places[0] = splat32(Places::ENDS - Places::ENDS) + ends;
        places[1] = splat32(Places::VALENCE) + (corner << 4) + ((degree & ~many) | (splat32(15) & many));
        if constexpr (positions)
            shape(base, corner, kind, places);
        else
            places[2] = splat32(Places::SHAPE) + corner;
        I32x4 score = splat32(0);
        for (int j = 0; j < TERMS; j++) {
            I32x4 term = {scores_[static_cast<size_t>(places[j][0])], scores_[static_cast<size_t>(places[j][1])],
                          scores_[static_cast<size_t>(places[j][2])], scores_[static_cast<size_t>(places[j][3])]};
            score += term;
            store(places_of[j] + lanes, places[j]);
        }
        I32x4 limit = splat32(static_cast<int>(SCORE_LIMIT));
        I32x4 over = score > limit, under = score < -limit;
        score = (score & ~(over | under)) | (limit & over) | (-limit & under);
        F32x4 weight = reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(power(score)) & valid);
        score = (score & valid) | (splat32(NO_SCORE) & ~valid);
        store(vertex_of + lanes, vertex);
        store(corner_of + lanes, corner);
        store(score_of + lanes, score);
        store(weight_of + lanes, weight);
        totals_ = totals_ + weight;
        count += std::popcount(static_cast<unsigned>(signs(valid)));
        lanes += 4;
    }
    // Children of one coarse vertex, at most as many as fit.
    template <bool all = false>
    MESHTIDE_INLINE void add(int32_t base, int32_t size, int kind) {
        for (int32_t done = 0; done < size && lanes < LANE_LIMIT; done += 4)
            add_block<all>(base + done, std::min(size - done, 4), kind);
    }
    void weigh() { total = (totals_[0] + totals_[1]) + (totals_[2] + totals_[3]); }

    void drop(int lane) {
        total = 0;
        score_of[lane] = NO_SCORE;
        weight_of[lane] = 0;
        count--;
        for (int i = 0; i < lanes; i++) total += weight_of[i];
    }
    int find(int32_t vertex) const {
        int found = NONE;
        for (int i = 0; i < lanes; i++)
            if (vertex_of[i] == vertex && score_of[i] != NO_SCORE && (found < 0 || corner_of[i] < corner_of[found]))
                found = i;
        return found;
    }

    // The candidate with the greatest score, the first of them, and the one that comes next; NONE if there is none.
    struct Best {
        int best, rival;
    };
    MESHTIDE_INLINE Best find_best() const {
        I32x4 top = splat32(NO_SCORE * 2), next = top; // keys: 128 score + 127 - lane
        I32x4 place = {127, 126, 125, 124};
        for (int i = 0; i < lanes; i += 4) {
            I32x4 score = load<I32x4>(score_of + i);
            I32x4 valid = score != splat32(NO_SCORE);
            I32x4 key = (((score << 7) + place - splat32(i)) & valid) | (splat32(NO_SCORE * 2) & ~valid);
            I32x4 higher = key > top;
            I32x4 lower = (key & ~higher) | (top & higher);
            top = (key & higher) | (top & ~higher);
            higher = lower > next;
            next = (lower & higher) | (next & ~higher);
        }
        int best = NO_SCORE * 2, rival = best;
        for (int i = 0; i < 4; i++) {
            rival = std::max(rival, std::min(best, top[i]));
            best = std::max(best, top[i]);
        }
        for (int i = 0; i < 4; i++) rival = std::max(rival, next[i]);
        return {best > NO_SCORE ? 127 - (best & 127) : NONE, rival > NO_SCORE ? 127 - (rival & 127) : NONE};
    }

    // One step of the scores after a choice, with the weights that it was made with.
    void learn(int chosen, float all, const float* weights) {
        constexpr float STEP = 20;
        for (int i = 0; i < lanes; i += 4) {
            F32x4 weight = load<F32x4>(weights + i);
            I32x4 here = splat32(chosen - i) == I32x4{0, 1, 2, 3};
            F32x4 one = reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(splat(1.0f)) & here);
            I32x4 step = truncate((one - weight / splat(all)) * splat(STEP));
            for (int k = 0; k < 4; k++) {
                if (step[k] == 0) continue;
                for (int j = 0; j < TERMS; j++) {
                    int16_t& score = scores_[static_cast<size_t>(places_of[j][i + k])];
                    score = static_cast<int16_t>(std::clamp(score + step[k], -8000, 8000));
                }
            }
        }
    }

    // Is it a vertex that a face at this gate can have only where edges have several faces?
    bool is_blocked(int32_t vertex) const {
        if (front_.vertex(vertex).out == NONE) return true;
        for (int i = 0; i < blocked_count; i++)
            if (blocked[i] == vertex) return true;
        return false;
    }

private:
    // The vertices around the gate's ends, on from the face behind, to which no gate leads.
    MESHTIDE_INLINE void block_fans(int32_t half_edge) {
        blocked[0] = known;
        blocked_count = 1;
        for (int32_t h = next_half_edge(half_edge); blocked_count < FAN_LIMIT;) {
            int32_t twin = front_.twin(h); // h leaves `first`
            if (twin < NONE) break;
            blocked[blocked_count++] = front_.corner(next_half_edge(h));
            if (twin == NONE) break;
            h = next_half_edge(twin);
        }
        int limit = blocked_count + FAN_LIMIT;
        for (int32_t h = previous_half_edge(half_edge); blocked_count < limit;) {
            int32_t twin = front_.twin(h); // h reaches `second`
            if (twin < NONE) break;
            blocked[blocked_count++] = front_.corner(h);
            if (twin == NONE) break;
            h = previous_half_edge(twin);
        }
    }
    static MESHTIDE_INLINE void spread(F32x4 p, F32x4& x, F32x4& y, F32x4& z) {
        x = splat(p[0]), y = splat(p[1]), z = splat(p[2]);
    }
    // 0..15 by halves of octaves, from 1/4 on.
    static MESHTIDE_INLINE I32x4 octave(F32x4 x, float from) {
        x = least(greatest(x * splat(0.25f / from), splat(0.25f)), splat(63.0f));
        return (reinterpret_cast<I32x4>(x) >> 22) - splat32(250);
    }
    static MESHTIDE_INLINE I32x4 sixteenth(F32x4 cosine) {
        return truncate(least(greatest(cosine + splat(8.0f), splat(0.0f)), splat(15.0f)));
    }
    MESHTIDE_INLINE void shape(int32_t base, I32x4 corner, int kind, I32x4* places) {
        const VertexRow* rows = front_.four_rows(base);
        F32x4 r0 = rows[0], r1 = rows[1], r2 = rows[2], r3 = rows[3];
        F32x4 t0 = __builtin_shufflevector(r0, r1, 0, 4, 1, 5), t1 = __builtin_shufflevector(r2, r3, 0, 4, 1, 5);
        F32x4 t2 = __builtin_shufflevector(r0, r1, 2, 6, 3, 7), t3 = __builtin_shufflevector(r2, r3, 2, 6, 3, 7);
        F32x4 x = __builtin_shufflevector(t0, t1, 0, 1, 4, 5), y = __builtin_shufflevector(t0, t1, 2, 3, 6, 7);
        F32x4 z = __builtin_shufflevector(t2, t3, 0, 1, 4, 5);
        F32x4 dx = x - px_, dy = y - py_, dz = z - pz_, ex = x - qx_, ey = y - qy_, ez = z - qz_;
        F32x4 ii = dx * dx + dy * dy + dz * dz, jj = ex * ex + ey * ey + ez * ez;
        F32x4 nm = dx * ax_ + dy * ay_ + dz * az_;
        F32x4 t = ii + (length_ - jj);
        F32x4 nn = greatest(length_ * ii - t * t * splat(0.25f), splat(0.0f));
        I32x4 angle = sixteenth((ii + jj - length_) * splat(4.0f) / square_root(ii * jj + splat(1e-20f)));
        I32x4 bend = sixteenth(nm * splat(8.0f) / square_root(nn * normal_length_ + splat(1e-20f)));
        F32x4 gx = x - fx_, gy = y - fy_, gz = z - fz_;
        F32x4 far = gx * gx + gy * gy + gz * gz;
        places[2] = splat32(Places::SHAPE) + (corner << 8) + (bend << 4) + angle;
        places[3] = splat32(Places::LENGTHS + std::min(kind, 3)) + (octave(greatest(ii, jj), 0.25f) << 6) +
                    (octave(least(ii, jj), 0.25f) << 2);
        places[4] = splat32(Places::APART) + (corner << 4) + octave(far * scale_, 0.03125f);
    }

    const Front& front_;
    Span<int16_t> scores_;
    int32_t ends_[4];
    F32x4 totals_;
    F32x4 px_, py_, pz_, qx_, qy_, qz_, ax_, ay_, az_, fx_, fy_, fz_, length_, scale_, normal_length_;
};

} // namespace meshtide::inline MESHTIDE_ISA
