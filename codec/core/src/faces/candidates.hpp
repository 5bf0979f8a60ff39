// The candidates for the apex of a new face, and what each of them is worth.
//
// Candidates come as ranges of vertices, the children of coarse vertices. Those that may be the apex are listed, and
// then looked at four at a time. Each gets a score, a sum of trained numbers at places that its properties choose (a
// log-linear model, in 256ths of a doubling), and a weight, two to the power of the score. The scores go on learning:
// softmax regression, one step a choice.
#pragma once

#include "base/effort.hpp"
#include "faces/coarse.hpp"
#include "faces/front.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

constexpr int SEEN_LIMIT = 96;        // vertices that a gate looks at
constexpr int LANES = SEEN_LIMIT + 4; // with room behind the last one

// Where a candidate comes from.
enum Kind {
    AHEAD = 0,   // a child of the apex of the coarse face that lies ahead
    COVERED = 1, // the same, but the coarse face has an image already
    SIBLING = 2, // another child of the parents of the gate's ends
    WITHIN = 3,  // another child of the parent, at a gate inside of one cell
    AROUND = 4,  // a child of a cell around that
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
    static constexpr int ROOM = static_cast<int>(std::bit_ceil(static_cast<unsigned>(COUNT)));
    // Those of effort high.
    static constexpr int RATIOS = 0, TURN_APEX = 0, TURN_END = 0, FOLD_END = 0, LACK_END = 0, LACK_APEX = 0, STEP = 0;
    static constexpr int TERMS = 5;
};
template <>
struct ScorePlaces<Effort::high, true> {
    static constexpr int SHAPE = 0;                         // 256 corner + 16 bend + angle
    static constexpr int LENGTHS = SHAPE + 256 * CORNERS;   // 64 longer + 4 shorter + kind
    static constexpr int ENDS = LENGTHS + 1024;             // 16 lesser + difference, for each closing
    static constexpr int VALENCE = ENDS + 4 * 128;          // 16 corner + faces
    static constexpr int APART = VALENCE + 16 * CORNERS;    // 16 corner + distance from a parallelogram
    static constexpr int RATIOS = APART + 16 * CORNERS;     // 64 longer + 4 shorter, to the gate's length, + closing
    static constexpr int TURN_APEX = RATIOS + 1024;         // 32 (8 corner's flags + faces) + sum of the angles
    static constexpr int TURN_END = TURN_APEX + 8 * 8 * 32; // 32 (8 closed + faces) + sum of the angles
    static constexpr int FOLD_END = TURN_END + 2 * 8 * 32;  // 16 (8 closed + faces) + bend at the edge that closes
    static constexpr int LACK_END = FOLD_END + 2 * 16;      // 2 lack + shared
    static constexpr int LACK_APEX = LACK_END + 64;         // 4 lack + closing
    static constexpr int STEP = LACK_APEX + 128;            // 32 (2 bend) + 2 apart + [it closes]
    static constexpr int INSIDE = STEP + 16 * 16 * 2;       // (16 corner's flags + margin) 4 + how many in its sphere
    static constexpr int COUNT = INSIDE + 8 * 16 * 4;
    static constexpr int ROOM = static_cast<int>(std::bit_ceil(static_cast<unsigned>(COUNT)));
    static constexpr int TERMS = 16;
};
template <>
struct ScorePlaces<Effort::standard, false> {
    static constexpr int SHAPE = 0; // corner
    static constexpr int ENDS = SHAPE + CORNERS;
    static constexpr int VALENCE = ENDS + 4 * 128;
    static constexpr int COUNT = VALENCE + 16 * CORNERS;
    static constexpr int ROOM = static_cast<int>(std::bit_ceil(static_cast<unsigned>(COUNT)));
    static constexpr int TERMS = 3;
};
template <>
struct ScorePlaces<Effort::either, true> : ScorePlaces<Effort::high, true> {
    typedef ScorePlaces<Effort::standard, false> Blind;
    typedef ScorePlaces<Effort::standard, true> Standard;
    typedef ScorePlaces<Effort::high, true> High;
    static constexpr BySight<Blind::ENDS, Standard::ENDS, High::ENDS> ENDS{};
    static constexpr BySight<Blind::VALENCE, Standard::VALENCE, High::VALENCE> VALENCE{};
    static constexpr BySight<Blind::COUNT, Standard::COUNT, High::COUNT> COUNT{};
    static constexpr BySight<Blind::TERMS, Standard::TERMS, High::TERMS> TERMS{};
    static constexpr BySight<Blind::ROOM, Standard::ROOM, High::ROOM> ROOM{};
};

// What a walk asks at each step: constants, but for those of either effort.
template <Effort effort, bool positions>
struct FacesAsk {
    static constexpr bool high = effort == Effort::high && positions, sighted = positions;
};
template <>
struct FacesAsk<Effort::either, true> {
    static constexpr BySight<false, false, true> high{};
    static constexpr BySight<false, true, true> sighted{};
};

constexpr int NO_SCORE = -100000000;
constexpr int SCORE_RANGE = 5000; // below the best one, no candidate is worth less than this

// Two to the power of a score in 256ths, linear between powers: the bits of a float are nearly its logarithm.
MESHTIDE_INLINE F32x4 power(I32x4 score) { return reinterpret_cast<F32x4>((score << 15) + splat32(127 << 23)); }
// The other way round.
MESHTIDE_INLINE int logarithm(float x) { return (std::bit_cast<int32_t>(x) - (127 << 23)) >> 15; }

template <Effort effort, bool positions>
class Candidates {
public:
    using Places = ScorePlaces<effort, positions>;
    static constexpr auto TERMS = Places::TERMS;
    static constexpr int MOST_TERMS = AT_MOST<effort, (positions ? 5 : 3), 16>;
    static constexpr auto high = FacesAsk<effort, positions>::high;
    static constexpr auto sighted = FacesAsk<effort, positions>::sighted;

    int32_t first, second, known;          // of the gate: the new face begins with first, second
    int32_t closing_first, closing_second; // the vertices that would close the edges at its ends, or NONE
    int lanes = 0, count = 0;              // lanes in use, a multiple of four; candidates in them
    float total = 0;                       // of the weights
    int32_t vertex_of[LANES];
    int32_t kind_of[LANES];
    int32_t corner_of[LANES];
    int32_t score_of[LANES]; // NO_SCORE: there is no candidate in this lane any more
    float weight_of[LANES];
    int32_t places_of[MOST_TERMS][LANES];
    // High only. Of a coarse vertex: 8 (its children, up to 3, less one) + faces around without an image, up to 7.
    int first_lack = 0, second_lack = 0;
    int32_t lack_of[LANES];
    bool shared = false;

    Candidates(const Front& front, Span<int16_t> scores)
        : front_(front), scores_(scores.block(0, static_cast<size_t>(Places::ROOM))) {}

    // half_edge: of the face behind, second -> first; `known` is its apex. refused: a vertex that it is not, or NONE.
    void aim(int32_t half_edge, int32_t first_, int32_t second_, int32_t refused) {
        first = first_, second = second_, known = front_.corner(previous_half_edge(half_edge));
        refused_ = refused;
        serial_ = front_.next_serial();
        mark_fans(half_edge);
        lanes = count = seen_ = 0;
    }

    // Vertices base, base + 1, ... all: also those whose edges are all taken. lack: see above.
    MESHTIDE_INLINE void add(int32_t base, int32_t size, int kind, [[maybe_unused]] int lack, bool all) {
        size = std::min(size, SEEN_LIMIT - seen_);
        seen_ += size;
        const VertexState* states = front_.states(base, size);
        int end = count;
        for (int32_t i = 0; i < size; i++) {
            const VertexState& state = states[i];
            int32_t vertex = base + i;
            bool valid = (vertex != first) & (vertex != second);
            if (!all) valid &= (vertex != refused_) & (state.out != NONE) & (state.mark != serial_);
            vertex_of[end] = vertex;
            kind_of[end] = kind;
            if (high) lack_of[end] = lack;
            end += valid;
        }
        count = end;
    }

    // When all are there.
    void weigh() {
        aim_shapes();
        while (lanes < count) score_four();
        if constexpr (effort != Effort::standard)
            if (high) look_inside();
        I32x4 top = splat32(NO_SCORE);
        for (int i = 0; i < lanes; i += 4) top = greatest32(top, load<I32x4>(score_of + i));
        I32x4 lowest = greatest_of(top) - splat32(SCORE_RANGE);
        F32x4 totals = splat(0);
        for (int i = 0; i < lanes; i += 4) {
            I32x4 score = load<I32x4>(score_of + i);
            I32x4 valid = score != splat32(NO_SCORE);
            score = greatest32(score, lowest);
            store(score_of + i, (score & valid) | (splat32(NO_SCORE) & ~valid));
            F32x4 weight = reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(power(score - lowest)) & valid);
            store(weight_of + i, weight);
            totals = totals + weight;
        }
        total = (totals[0] + totals[1]) + (totals[2] + totals[3]);
    }

    void drop(int lane) {
        score_of[lane] = NO_SCORE;
        weight_of[lane] = 0;
        count--;
        F32x4 totals = splat(0);
        for (int i = 0; i < lanes; i += 4) totals = totals + load<F32x4>(weight_of + i);
        total = (totals[0] + totals[1]) + (totals[2] + totals[3]);
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
    MESHTIDE_ONCE Best find_best() const {
        I32x4 top = splat32(NO_SCORE * 2), next = top; // keys: 128 score + 127 - lane
        I32x4 place = {127, 126, 125, 124};
        for (int i = 0; i < lanes; i += 4) {
            I32x4 score = load<I32x4>(score_of + i);
            I32x4 valid = score != splat32(NO_SCORE);
            I32x4 key = (((score << 7) + place - splat32(i)) & valid) | (splat32(NO_SCORE * 2) & ~valid);
            next = greatest32(next, least32(key, top));
            top = greatest32(key, top);
        }
        I32x4 first_of_all = greatest_of(top), here = top == first_of_all;
        int best = first_of_all[0], rival = greatest_of((next & here) | (top & ~here))[0];
        return {best > NO_SCORE ? 127 - (best & 127) : NONE, rival > NO_SCORE ? 127 - (rival & 127) : NONE};
    }

    // One step of the scores after a choice, with the weights that it was made with.
    void learn(int chosen, float all, const float* weights) {
        const float PACE = high ? 20 : 50;
        // What is left of a step of which only the whole part counts is as often 1 as it is large.
        learned_ += 0x9E3779B9u;
        float dither = static_cast<float>(learned_ >> 8) * 0x1p-24f + 1024;
        for (int i = 0; i < lanes; i += 4) {
            F32x4 weight = load<F32x4>(weights + i);
            I32x4 here = splat32(chosen - i) == I32x4{0, 1, 2, 3};
            F32x4 one = reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(splat(1.0f)) & here);
            I32x4 step = truncate((one - weight / splat(all)) * splat(PACE) + splat(dither)) - splat32(1024);
            for (int k = 0; k < 4; k++) {
                if (step[k] == 0 || weight[k] == 0) continue; // a lane without candidate learns nothing
                for (int j = 0; j < TERMS; j++) {
                    int16_t& score = score_at(places_of[j][i + k]);
                    score = static_cast<int16_t>(std::clamp(score + step[k], -32000, 32000));
                }
            }
        }
    }

    // Is it a vertex that a face at this gate can have only where edges have several faces?
    bool is_blocked(int32_t vertex) const {
        const VertexState& state = front_.vertex(vertex);
        return state.out == NONE || state.mark == serial_;
    }

private:
    // A stream cannot make a place that the mask would change.
    MESHTIDE_INLINE int16_t& score_at(int32_t place) const {
        return scores_[static_cast<size_t>(place & (Places::ROOM - 1))];
    }

    MESHTIDE_INLINE void mark(int32_t vertex) const { front_.vertex(vertex).mark = serial_ & 0x3fffffff; }
    // Marks the vertices around the gate's ends, on from the face behind, to which no gate leads.
    MESHTIDE_INLINE void mark_fans(int32_t half_edge) const {
        mark(known);
        int step = 1;
        for (int32_t h = next_half_edge(half_edge); step < FAN_LIMIT; step++) {
            int32_t twin = front_.twin(h); // h leaves `first`
            if (twin < NONE) break;
            mark(front_.corner(next_half_edge(h)));
            if (twin == NONE) break;
            h = next_half_edge(twin);
        }
        step = 0;
        for (int32_t h = previous_half_edge(half_edge); step < FAN_LIMIT; step++) {
            int32_t twin = front_.twin(h); // h reaches `second`
            if (twin < NONE) break;
            mark(front_.corner(h));
            if (twin == NONE) break;
            h = previous_half_edge(twin);
        }
    }

    void aim_shapes() {
        const VertexState &a = front_.vertex(first), &b = front_.vertex(second);
        closing_first = a.out >= 0 ? front_.gate(a.out).to : NONE;
        closing_second = b.in >= 0 ? front_.gate(b.in).from : NONE;
        int u = std::min(a.degree, 7), v = std::min(b.degree, 7), least = std::min(u, v), apart = std::abs(u - v);
        ends_[0] = Places::ENDS + 16 * least + apart;
        ends_[1] = Places::ENDS + 128 + 16 * u + v;
        ends_[2] = Places::ENDS + 256 + 16 * v + u;
        ends_[3] = Places::ENDS + 384 + 16 * least + apart;
        for (int i = count; i < LANES && (i & 3) != 0; i++) {
            vertex_of[i] = first; // of no meaning
            kind_of[i] = 0;
            if (high) lack_of[i] = 0;
        }
        if (sighted) {
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
            if (high) {
                spread(side, sx_, sy_, sz_);
                aim_fold(a.out, folds_[0]);
                aim_fold(b.in, folds_[1]);
            }
        }
    }

    MESHTIDE_INLINE void score_four() {
        I32x4 vertex = load<I32x4>(vertex_of + lanes), kind = load<I32x4>(kind_of + lanes);
        const VertexState &s0 = front_.vertex(vertex[0]), &s1 = front_.vertex(vertex[1]);
        const VertexState &s2 = front_.vertex(vertex[2]), &s3 = front_.vertex(vertex[3]);
        I32x4 out = {s0.out, s1.out, s2.out, s3.out};
        I32x4 degree = {s0.degree, s1.degree, s2.degree, s3.degree};
        I32x4 valid = I32x4{0, 1, 2, 3} < splat32(count - lanes);
        I32x4 touched = out != splat32(UNTOUCHED);
        I32x4 closes1 = (vertex == splat32(closing_first)) & touched;
        I32x4 closes2 = (vertex == splat32(closing_second)) & touched;
        // Comparisons are -1.
        I32x4 corner = (kind << 3) - touched - 2 * closes1 - 4 * closes2;
        I32x4 both = closes1 & closes2;
        I32x4 ends = splat32(ends_[0]) + (closes1 & splat32(ends_[1] - ends_[0])) +
                     (closes2 & splat32(ends_[2] - ends_[0])) +
                     (both & splat32(ends_[3] - ends_[2] - ends_[1] + ends_[0]));
        I32x4 places[MOST_TERMS];
        places[0] = ends;
        places[1] = splat32(Places::VALENCE) + (corner << 4) + no_more(degree, 15);
        if (!sighted) places[2] = splat32(Places::SHAPE) + corner;
        if constexpr (positions)
            if (sighted) shape(vertex, corner, degree, kind, places);
        I32x4 score = splat32(0);
        for (int j = 0; j < TERMS - high; j++) {
            score +=
                I32x4{score_at(places[j][0]), score_at(places[j][1]), score_at(places[j][2]), score_at(places[j][3])};
            store(places_of[j] + lanes, places[j]);
        }
        score = ((score >> 2) & valid) | (splat32(NO_SCORE) & ~valid);
        store(corner_of + lanes, corner);
        store(score_of + lanes, score);
        lanes += 4;
    }
    // The normal of the face behind a gate that a candidate would close, and its squared length.
    struct Fold {
        F32x4 x, y, z, length;
    };
    void aim_fold(int32_t k, Fold& fold) const {
        F32x4 normal = splat(0);
        if (k >= 0) {
            int32_t h = front_.gate(k).half_edge, after = next_half_edge(h);
            F32x4 a = front_.position(front_.corner(h)), b = front_.position(front_.corner(after));
            normal = cross3(b - a, front_.position(front_.corner(next_half_edge(after))) - a);
        }
        spread(normal, fold.x, fold.y, fold.z);
        fold.length = splat(dot3(normal, normal));
    }
    static MESHTIDE_INLINE I32x4 no_more(I32x4 a, int limit) {
        I32x4 over = a > splat32(limit);
        return (a & ~over) | (splat32(limit) & over);
    }
    static MESHTIDE_ONCE void spread(F32x4 p, F32x4& x, F32x4& y, F32x4& z) {
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
    MESHTIDE_INLINE void shape(I32x4 vertex, I32x4 corner, I32x4 degree, I32x4 kind, I32x4* places) {
        F32x4 r0 = front_.row(vertex[0]), r1 = front_.row(vertex[1]);
        F32x4 r2 = front_.row(vertex[2]), r3 = front_.row(vertex[3]);
        F32x4 t0 = __builtin_shufflevector(r0, r1, 0, 4, 1, 5), t1 = __builtin_shufflevector(r2, r3, 0, 4, 1, 5);
        F32x4 t2 = __builtin_shufflevector(r0, r1, 2, 6, 3, 7), t3 = __builtin_shufflevector(r2, r3, 2, 6, 3, 7);
        F32x4 x = __builtin_shufflevector(t0, t1, 0, 1, 4, 5), y = __builtin_shufflevector(t0, t1, 2, 3, 6, 7);
        F32x4 z = __builtin_shufflevector(t2, t3, 0, 1, 4, 5);
        F32x4 dx = x - px_, dy = y - py_, dz = z - pz_, ex = x - qx_, ey = y - qy_, ez = z - qz_;
        F32x4 ii = dx * dx + dy * dy + dz * dz, jj = ex * ex + ey * ey + ez * ez;
        F32x4 nm = dx * ax_ + dy * ay_ + dz * az_;
        F32x4 t = ii + (length_ - jj);
        F32x4 nn = greatest(length_ * ii - t * t * splat(0.25f), splat(0.0f));
        F32x4 cosine = (ii + jj - length_) * splat(0.5f) / square_root(ii * jj + splat(1e-20f));
        I32x4 angle = sixteenth(cosine * splat(8.0f));
        I32x4 bend = sixteenth(nm * splat(8.0f) / square_root(nn * normal_length_ + splat(1e-20f)));
        F32x4 gx = x - fx_, gy = y - fy_, gz = z - fz_;
        F32x4 far = gx * gx + gy * gy + gz * gz;
        places[2] = splat32(Places::SHAPE) + (corner << 8) + (bend << 4) + angle;
        places[3] = splat32(Places::LENGTHS) + no_more(kind, 3) + (octave(greatest(ii, jj), 0.25f) << 6) +
                    (octave(least(ii, jj), 0.25f) << 2);
        I32x4 apart = octave(far * scale_, 0.03125f);
        places[4] = splat32(Places::APART) + (corner << 4) + apart;
        if (high) {
            I32x4 flags = corner & splat32(7), closing = flags >> 1;
            I32x4 closes1 = closing & splat32(1), closes2 = closing >> 1;
            places[5] = splat32(Places::RATIOS) + (octave(greatest(ii, jj) * scale_, 0.125f) << 6) +
                        (octave(least(ii, jj) * scale_, 0.03125f) << 2) + closing;
            // Sums of angles, 16 to half a turn.
            F32x4 at1 = arc((length_ + ii - jj) * splat(0.5f) / square_root(length_ * ii + splat(1e-20f)));
            F32x4 at2 = arc((length_ + jj - ii) * splat(0.5f) / square_root(length_ * jj + splat(1e-20f)));
            F32x4 at3 = arc(cosine);
            I32x4 faces = no_more(degree, 7);
            auto turn = [](F32x4 sum) { return truncate(least(sum * splat(12.0f), splat(31.0f))); };
            places[6] = splat32(Places::TURN_APEX) + (((flags << 3) + faces) << 5) +
                        turn(F32x4{front_.angle(vertex[0]), front_.angle(vertex[1]), front_.angle(vertex[2]),
                                   front_.angle(vertex[3])} +
                             at3);
            places[7] = splat32(Places::TURN_END) +
                        (((closes1 << 3) + splat32(std::min(front_.vertex(first).degree, 7))) << 5) +
                        turn(splat(front_.angle(first)) + at1);
            places[8] = splat32(Places::TURN_END) +
                        (((closes2 << 3) + splat32(std::min(front_.vertex(second).degree, 7))) << 5) +
                        turn(splat(front_.angle(second)) + at2);
            // The new normal, side x d, against those of the faces at edges that close.
            F32x4 nx = sy_ * dz - sz_ * dy, ny = sz_ * dx - sx_ * dz, nz = sx_ * dy - sy_ * dx;
            for (int i = 0; i < 2; i++) {
                const Fold& fold = folds_[i];
                F32x4 dot = nx * fold.x + ny * fold.y + nz * fold.z;
                I32x4 folded = sixteenth(dot * splat(8.0f) / square_root(nn * fold.length + splat(1e-20f)));
                I32x4 closes = i == 0 ? closes1 : closes2;
                places[9 + i] = splat32(Places::FOLD_END) + (folded & (splat32(0) - closes)) + (closes << 4);
            }
            I32x4 own = kind == splat32(AHEAD); // -1
            auto lack = [&](I32x4 coded, I32x4 closed) {
                I32x4 left = (coded & splat32(7)) + own;
                left = left & (left > splat32(0));
                return closed * 15 + (coded >> 3) * 5 + no_more(left, 4);
            };
            places[11] = splat32(Places::LACK_END + shared) + (lack(splat32(first_lack), closes1) << 1);
            places[12] = splat32(Places::LACK_END + shared) + (lack(splat32(second_lack), closes2) << 1);
            places[13] =
                splat32(Places::LACK_APEX) + (lack(load<I32x4>(lack_of + lanes), closes1 & closes2) << 2) + closing;
            places[14] = splat32(Places::STEP) + (bend << 5) + (apart << 1) + (closes1 | closes2);
            // The sphere through the three, around a point of their plane.
            F32x4 ed = t * splat(0.5f), det = splat(2.0f) * (length_ * ii - ed * ed);
            F32x4 safe = greatest(det, splat(1e-6f));
            F32x4 u = ii * (length_ - ed) / safe, w = length_ * (ii - ed) / safe;
            store(dx_of_ + lanes, dx), store(dy_of_ + lanes, dy), store(dz_of_ + lanes, dz);
            store(cx_of_ + lanes, u * sx_ + w * dx), store(cy_of_ + lanes, u * sy_ + w * dy);
            store(cz_of_ + lanes, u * sz_ + w * dz);
        }
    }
    // How far others are inside the spheres, which is known when all are there.
    void look_inside() {
        for (int i = 0; i < lanes; i++) {
            if (score_of[i] == NO_SCORE) {
                places_of[15][i] = Places::INSIDE;
                continue;
            }
            F32x4 cx = splat(cx_of_[i]), cy = splat(cy_of_[i]), cz = splat(cz_of_[i]);
            float radius = cx_of_[i] * cx_of_[i] + cy_of_[i] * cy_of_[i] + cz_of_[i] * cz_of_[i];
            F32x4 nearest = splat(4.0f) * splat(radius);
            int inside = 0;
            for (int j = 0; j < lanes && j < 32; j += 4) {
                F32x4 x = load<F32x4>(dx_of_ + j) - cx, y = load<F32x4>(dy_of_ + j) - cy,
                      z = load<F32x4>(dz_of_ + j) - cz;
                F32x4 way = x * x + y * y + z * z;
                I32x4 other = (load<I32x4>(score_of + j) != splat32(NO_SCORE)) & (splat32(i - j) != I32x4{0, 1, 2, 3});
                inside += std::popcount(static_cast<unsigned>(signs((way < splat(radius * 0.96875f)) & other)));
                way = reinterpret_cast<F32x4>((reinterpret_cast<I32x4>(way) & other) |
                                              (reinterpret_cast<I32x4>(nearest) & ~other));
                nearest = least(nearest, way);
            }
            float least_way = std::min(std::min(nearest[0], nearest[1]), std::min(nearest[2], nearest[3]));
            float share = least_way / radius * 8.0f; // no number if the sphere is too large for floats
            int margin = share >= 15 ? 15 : share > 0 ? static_cast<int>(share) : 0;
            int32_t place = Places::INSIDE + (((corner_of[i] & 7) * 16 + margin) * 4 + std::min(inside, 3));
            places_of[15][i] = place;
            score_of[i] += score_at(place) >> 2;
        }
    }

    static constexpr int FAN_LIMIT = 8;

    const Front& front_;
    int16_t* scores_; // Places::ROOM of them
    uint32_t learned_ = 0, serial_ = 0;
    int32_t refused_ = NONE;
    int seen_ = 0; // vertices that were looked at
    int32_t ends_[4];
    Fold folds_[2];
    F32x4 sx_, sy_, sz_;
    float dx_of_[LANES], dy_of_[LANES], dz_of_[LANES];
    float cx_of_[LANES], cy_of_[LANES], cz_of_[LANES];
    F32x4 px_, py_, pz_, qx_, qy_, qz_, ax_, ay_, az_, fx_, fy_, fz_, length_, scale_, normal_length_;
};

} // namespace meshtide::inline MESHTIDE_ISA
