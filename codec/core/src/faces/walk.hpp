// The walk over a fine level, which codes its faces one after the other (docs/format.md, Connectivity).
//
// C. Touma and C. Gotsman, "Triangle mesh compression", 1998, with the coarse level as the source of candidates. Gates
// are a stack; those whose candidates are in doubt wait until nothing else is left.
#pragma once

#include "faces/decisions.hpp"
#include "faces/truth.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// Arrays of one walk, kept for the next, and what bounds them.
struct FacesMemory {
    explicit FacesMemory(Budget& budget_)
        : budget(budget_), front(budget), coarse(budget), stack(budget), later(budget), within(budget), truth(budget) {}
    Budget& budget;
    FrontMemory front;
    CoarseMemory coarse;
    Array<int32_t> stack, later, within; // half-edges of gates
    TruthIndex truth;                    // encoder only
    bool open = false;                   // encoder only: the last level that was clean was not closed

    // Gives back what a level of so many vertices has taken, where that is much.
    void rest(size_t vertices) {
        if (vertices < ROOMY) return;
        front.give_back();
        coarse.give_back();
        stack.give_back();
        later.give_back();
        within.give_back();
        truth.rest();
    }
};

// What the encoder finds out about a level before it writes it.
struct FacesTraits {
    bool several = false; // edges of the coarse level have more than one face a side
    bool closed = false;  // every gate has a face among its candidates
    bool clean = false;   // nothing but gates and seeds is needed
    bool extra = true;    // there are faces at edges that have their two
    bool operator==(const FacesTraits&) const = default;
};

template <Effort effort, bool positions, class Coder>
class FacesWalk {
    using Model = FacesModel<effort, positions>;
    using C = FacesContexts;
    static constexpr auto high = FacesAsk<effort, positions>::high;
    static constexpr auto sighted = FacesAsk<effort, positions>::sighted;
    // At effort high, a gate whose best candidate has no more than this share of the weights waits.
    static constexpr float DOUBT = 0.6f;

public:
    FacesWalk(Coder& coder, const Level& coarse, Level& fine, Model& model, FacesMemory& memory, FacesTraits traits)
        : coarse_level_(coarse), fine_(fine), memory_(memory), traits_(traits), front_(fine, memory.front),
          coarse_(coarse, memory.coarse, traits.several), candidates_(front_, model.scores.span()),
          decisions_(coder, model, candidates_), truth_(memory.truth) {}

    // An encoder's walk ends early where the level is not what was said of it.
    void run(size_t faces) {
        prepare(faces);
        copy_faces();
        run_gates();
        int32_t seed = 0, edge = 0;
        while (!failed() && !front_.full()) {
            if (traits_.extra && code_extra(edge)) {
            } else if (next_seed(seed)) {
                code_seed(seed);
            } else if (!traits_.clean) {
                code_leftover();
            } else {
                if constexpr (Coder::encoding)
                    unclean_ = true;
                else
                    fail(Fault::malformed, "faces are missing");
            }
            run_gates();
        }
        if (!failed()) front_.finish();
    }
    // What should have been said of the level (encoders only): the walk was right if it was said.
    FacesTraits found() const {
        FacesTraits found = traits_;
        found.closed = !unanswered_ && (traits_.closed || !unclean_);
        if (unclean_)
            found.clean = false, found.extra = truth_.edges_repeat();
        else if (!failed() && !traits_.clean)
            found.extra = had_extra_;
        return found;
    }

private:
    // The level is not what was said of it.
    bool failed() const { return Coder::encoding && (unclean_ || (unanswered_ && traits_.closed)); }
    int code(uint32_t place, bool bit) { return decisions_.code(place, bit); }
    void prepare(size_t faces) {
        size_t n = fine_.parents.size();
        FrontMemory& m = memory_.front;
        m.vertices.renew(n);
        float scale = 1;
        if (sighted) scale = 1 / unit_;
        Span<VertexState> states = m.vertices.span();
        for (size_t v = 0; v < n; v++) {
            auto parent = static_cast<int32_t>(fine_.parents[v]);
            F32x4 row = sighted ? fine_.centres[v] * splat(scale) : splat(0);
            auto bits = reinterpret_cast<I32x4>(row);
            bits[3] = parent;
            states[v] = {reinterpret_cast<F32x4>(bits), UNTOUCHED, NONE, 0, coarse_.split(parent), 0};
        }
        m.serial = 0;
        if (high) m.angles.assign(n, 0);
        front_.start(faces, std::max(faces, coarse_.face_count()));
        memory_.stack.clear();
        memory_.later.clear();
        memory_.within.clear();
        later_next_ = within_next_ = 0;
        unclean_ = unanswered_ = false;
    }

    void copy_faces() {
        front_.copy(coarse_level_, [&](int32_t h) { coarse_.copy(h); });
        Span<const int32_t> free_slots = memory_.front.free_slots.span();
        auto faces = static_cast<int32_t>(coarse_.face_count());
        if (Coder::encoding || high)
            for (int32_t h = 0; h < 4 * faces; h += 4) {
                if (!coarse_.copied(h)) continue;
                int32_t a = front_.corner(h), b = front_.corner(h + 1), c = front_.corner(h + 2);
                if (high) front_.add_angles(a, b, c);
                if constexpr (Coder::encoding) tell_copy(a, b, c);
            }
        if (front_.face_count() == 0) return;
        for (size_t i = 0; i < free_slots.size(); i++) {
            int32_t t = free_slots[i];
            for (int32_t h = 4 * t; h < 4 * t + 3; h++) {
                int32_t behind = coarse_.twin(h);
                if (behind < 0 || !coarse_.copied(behind)) continue;
                int32_t p = coarse_.origin(h), q = coarse_.origin(next_half_edge(h));
                leave(behind, coarse_.first_child(q), coarse_.first_child(p), h);
            }
        }
        if (!coarse_.any_crowded()) return;
        for (int32_t t = 0; t < faces; t++) {
            if (!coarse_.copied(4 * t)) continue;
            for (int32_t h = 4 * t; h < 4 * t + 3; h++) {
                if (front_.twin(h) != NONE) continue;
                int32_t p = coarse_.origin(h), q = coarse_.origin(next_half_edge(h));
                if (!coarse_.crowded(q)) continue;
                int32_t ahead = coarse_.edge(q, p);
                if (ahead >= 0) leave(h, coarse_.first_child(p), coarse_.first_child(q), ahead);
            }
        }
    }
    void tell_copy(int32_t a, int32_t b, int32_t c) {
        int32_t face = b < a && b < c   ? truth_.find(b, c, a)
                       : c < a && c < b ? truth_.find(c, a, b)
                                        : truth_.find(a, b, c);
        if (face >= 0) truth_.mark_coded(face);
    }

    // A half-edge u -> v for which no gate waits: a gate of its own, if another face may stand there.
    MESHTIDE_ONCE void leave(int32_t h, int32_t u, int32_t v, int32_t ahead) {
        bool expected = ((front_.vertex(u).split | front_.vertex(v).split) & 1) != 0;
        if (!expected)
            coarse_.each_at(front_.parent(v), front_.parent(u), ahead, [&](int32_t k) {
                if (!coarse_.copied(k)) expected = true;
            });
        if (expected) {
            front_.open(h, u, v, ahead);
            memory_.stack.push(h);
        } else {
            front_.twin(h) = NONE;
        }
    }
    // The coarse half-edge p -> q whose face lies ahead.
    int32_t ahead(int32_t p, int32_t q) const { return p == q ? NONE : coarse_.edge(p, q); }
    // The coarse face above (first, second, apex), as its half-edge p -> q.
    int32_t image(int32_t p, int32_t q, int32_t r, int32_t known) const {
        int32_t found = NONE;
        if (p == q || q == r || r == p) return found;
        coarse_.each_at(p, q, known, [&](int32_t k) {
            if (found < 0 && coarse_.apex(k) == r) found = k;
        });
        return found;
    }

    // A face at gate k, with this apex. image: the coarse half-edge above its first one, or NONE.
    void add_face(int32_t k, int32_t apex, int32_t image) {
        Gate gate = front_.gate(k);
        int32_t first = gate.to, second = gate.from;
        int32_t p = front_.parent(first), q = front_.parent(second), r = front_.parent(apex);
        int32_t closing1 = NONE, closing2 = NONE;
        if (front_.vertex(apex).out >= 0) closing2 = front_.find_gate(apex, second);
        if (front_.vertex(apex).in >= 0) closing1 = front_.find_gate(first, apex);
        int32_t h = 4 * front_.add(first, second, apex);
        if (high) front_.add_angles(first, second, apex);
        front_.join(h, k);
        int32_t ahead1, ahead2;
        if (image >= 0) {
            coarse_.cover(image);
            ahead2 = coarse_.crowded(r) ? ahead(r, q) : coarse_.twin(next_half_edge(image));
            ahead1 = coarse_.crowded(p) ? ahead(p, r) : coarse_.twin(previous_half_edge(image));
        } else if (r == q) {
            ahead2 = NONE, ahead1 = r == p ? NONE : gate.ahead;
        } else if (r == p) {
            ahead2 = gate.ahead, ahead1 = NONE;
        } else {
            ahead2 = ahead(r, q), ahead1 = ahead(p, r);
        }
        if (closing2 >= 0)
            front_.join(h + 1, closing2);
        else
            leave(h + 1, second, apex, ahead2);
        if (closing1 >= 0)
            front_.join(h + 2, closing1);
        else
            leave(h + 2, apex, first, ahead1);
    }
    // A face from elsewhere.
    void add_loose(int32_t a, int32_t b, int32_t c) {
        int32_t corners[3] = {a, b, c}, above[3] = {front_.parent(a), front_.parent(b), front_.parent(c)};
        int32_t h = 4 * front_.add(a, b, c);
        if (high) front_.add_angles(a, b, c);
        cover(above[0], above[1], above[2]);
        for (int i = 0; i < 3; i++) {
            int j = i == 2 ? 0 : i + 1;
            int32_t k = front_.find_gate(corners[j], corners[i]);
            if (k >= 0)
                front_.join(h + i, k);
            else
                leave(h + i, corners[i], corners[j], ahead(above[j], above[i]));
        }
    }
    void cover(int32_t p, int32_t q, int32_t r) {
        if (p == q || q == r || r == p) return;
        coarse_.each_at(p, q, coarse_.edge(p, q), [&](int32_t k) {
            if (coarse_.apex(k) == r) coarse_.cover(k);
        });
    }

    // ---- gates

    void run_gates() {
        while (!failed() && !front_.full()) {
            if (!memory_.stack.empty()) {
                int32_t k = front_.gate_at(memory_.stack.pop());
                if (k >= 0) visit(k, false);
            } else if (later_next_ < memory_.later.size()) {
                int32_t k = front_.gate_at(memory_.later[later_next_++]);
                if (k >= 0) visit(k, true);
            } else if (within_next_ < memory_.within.size()) {
                int32_t k = front_.gate_at(memory_.within[within_next_++]);
                if (k >= 0) visit(k, true);
            } else {
                return;
            }
        }
    }

    void visit(int32_t k, bool late) {
        const Gate gate = front_.gate(k);
        int32_t first = gate.to, second = gate.from, p = front_.parent(first), q = front_.parent(second);
        bool shared = p == q;
        if (shared && !late) {
            memory_.within.push(gate.half_edge);
            return;
        }
        int32_t known = front_.corner(previous_half_edge(gate.half_edge));
        int32_t wanted = NONE, apex = NONE; // encoder: the face's corner and its apex
        if constexpr (Coder::encoding) {
            wanted = truth_.find(first, second);
            if (wanted >= 0) apex = truth_.vertex(wanted, 2);
        }

        // A hole that one triangle fills?
        int32_t refused = NONE;
        int32_t out = front_.vertex(first).out, in = front_.vertex(second).in;
        if (out >= 0 && in >= 0) {
            int32_t x = front_.gate(out).to;
            if (x == front_.gate(in).from && x != known) {
                int32_t r = front_.parent(x);
                uint32_t kind = shared ? 2 + (r == p) : r == p || r == q ? 1 : 0;
                if (kind == 0 && gate.ahead >= 0 && coarse_.apex(gate.ahead) == r)
                    kind = 4 + coarse_.covered(gate.ahead);
                if (code(C::HOLE + kind, apex == x) != 0) {
                    take(k, x, wanted);
                    return;
                }
                refused = x;
            }
        }

        for (int phase = 0; phase < (shared ? 2 : 1); phase++) {
            gather(gate, phase, refused);
            bool last = !shared || phase == 1, certain = traits_.closed && last;
            if (candidates_.count == 0) continue;
            if (certain && candidates_.count == 1) {
                if (Coder::encoding && candidates_.vertex_of[0] != apex) {
                    unanswered_ = true;
                    continue;
                }
                take(k, candidates_.vertex_of[0], wanted);
                return;
            }
            candidates_.weigh();
            int want = Coder::encoding && wanted >= 0 ? candidates_.find(apex) : NONE;
            auto top = candidates_.find_best();
            if (high && !late && candidates_.weight_of[top.best] < DOUBT * candidates_.total) {
                memory_.later.push(gate.half_edge);
                return;
            }
            if (want < 0 && last) unanswered_ = true;
            if (Coder::encoding && certain && want < 0) continue;
            if (!certain && decisions_.code_has_face(kind_of(gate, phase), top.best, want >= 0) == 0) continue;
            int lane = decisions_.choose(top, want, true);
            take(k, candidates_.vertex_of[lane], wanted);
            return;
        }
        if (!traits_.clean) {
            gather_all(gate.half_edge, first, second, true);
            bool listed = candidates_.count > 0;
            if (listed ? decisions_.code_has_face(kind_of(gate, 2), candidates_.find_best().best, wanted >= 0)
                       : code(C::ESCAPE + 2 * shared + (gate.ahead >= 0), wanted >= 0)) {
                take(k, code_apex(first, second, apex), wanted);
                return;
            }
        } else if (Coder::encoding && wanted >= 0) {
            unclean_ = true;
        }
        unanswered_ = true;
        front_.twin(gate.half_edge) = NONE;
        front_.vertex(first).split |= 2;
        front_.vertex(second).split |= 2;
        front_.close(k);
    }
    void take(int32_t k, int32_t apex, int32_t wanted) {
        if constexpr (Coder::encoding) truth_.mark_coded(wanted);
        const Gate& gate = front_.gate(k);
        int32_t p = front_.parent(gate.to), q = front_.parent(gate.from);
        add_face(k, apex, image(p, q, front_.parent(apex), gate.ahead));
    }

    // phase: 0 and, within a cell, 1; 2 with the candidates that are blocked.
    GateKind kind_of(const Gate& gate, int phase) const {
        const VertexState &a = front_.vertex(gate.to), &b = front_.vertex(gate.from);
        bool shared = front_.parent(gate.to) == front_.parent(gate.from);
        uint32_t family = shared ? static_cast<uint32_t>(phase) : gate.ahead < 0 ? 2 : 3 + coarse_.covered(gate.ahead);
        if (phase == 2) family = 5 + shared;
        return {family, static_cast<uint32_t>((a.split >> 1) + (b.split >> 1)),
                static_cast<uint32_t>((a.split | b.split) & 1)};
    }
    void gather(const Gate& gate, int phase, int32_t refused) {
        int32_t first = gate.to, second = gate.from;
        int32_t p = front_.parent(first), q = front_.parent(second);
        candidates_.aim(gate.half_edge, first, second, refused);
        if (high) tell_lack(p, q);
        if (p != q) {
            coarse_.each_at(p, q, gate.ahead, [&](int32_t k) { add_ahead(k, false); });
            add_children(p, SIBLING, first);
            add_children(q, SIBLING, second);
        } else if (phase == 0) {
            add_children(p, WITHIN, first);
        } else {
            add_around(p, false);
        }
    }
    // all: also those whose edges are all taken.
    MESHTIDE_ONCE void add_children(int32_t p, Kind kind, int32_t near = NONE, bool all = false) {
        int32_t base = coarse_.first_child(p), size = coarse_.child_count(p);
        if (near >= 0) {
            if (size == 1) return;
            if (size > 32) { // only those around
                int32_t end = std::min(base + size, near + 16);
                base = std::max(base, near - 16), size = end - base;
            }
        }
        candidates_.add(base, size, kind, high ? lack(p) : 0, all);
    }
    // Of the apex of a coarse half-edge's face.
    MESHTIDE_INLINE void add_ahead(int32_t k, bool all) {
        add_children(coarse_.apex(k), coarse_.covered(k) ? COVERED : AHEAD, NONE, all);
    }
    // Of the cells around p.
    MESHTIDE_ONCE void add_around(int32_t p, bool all) {
        coarse_.each_neighbour(p, [&](int32_t r) { add_children(r, AROUND, NONE, all); });
    }

    int lack(int32_t p) const { return 8 * (std::min(coarse_.child_count(p), 3) - 1) + coarse_.uncovered_around(p); }
    void tell_lack(int32_t p, int32_t q) {
        candidates_.first_lack = lack(p), candidates_.second_lack = lack(q);
        candidates_.shared = p == q;
    }

    // ---- what is rare

    // All vertices near a half-edge's face, in whatever state. refused: without those that its gate has offered.
    void gather_all(int32_t half_edge, int32_t first, int32_t second, bool refused) {
        candidates_.aim(half_edge, first, second, NONE);
        int32_t p = front_.parent(first), q = front_.parent(second);
        if (high) tell_lack(p, q);
        if (p != q) {
            coarse_.each_between(p, q, [&](int32_t k) { add_ahead(k, true); });
            add_children(p, SIBLING, first, true);
            add_children(q, SIBLING, second, true);
        } else {
            add_children(p, WITHIN, first, true);
            add_around(p, true);
        }
        candidates_.weigh();
        if (!refused) return;
        for (int i = 0; i < candidates_.lanes; i++)
            if (candidates_.score_of[i] != NO_SCORE && !candidates_.is_blocked(candidates_.vertex_of[i]))
                candidates_.drop(i);
    }
    // An apex among all vertices.
    int32_t code_apex(int32_t first, int32_t second, int32_t apex) {
        int want = Coder::encoding ? candidates_.find(apex) : NONE;
        if (candidates_.count > 0 && code(C::ESCAPE + 8, want >= 0) != 0) {
            return candidates_.vertex_of[decisions_.choose(candidates_.find_best(), want, false)];
        }
        return code_vertex(0, first, apex, second);
    }
    // A vertex by its number's distance, which is neither of these.
    int32_t code_vertex(uint32_t which, int32_t from, int32_t vertex, int32_t other) {
        int32_t found = from + decisions_.code_number(which, vertex - from);
        expect(found >= 0 && static_cast<size_t>(found) < fine_.parents.size() && found != from && found != other,
               "a corner that is none");
        return found;
    }

    // Another face at a half-edge that has its twin, or is border.
    bool code_extra(int32_t& edge) {
        for (; edge < 4 * static_cast<int32_t>(front_.slot_count()); edge++) {
            if ((edge & 3) == 3 || !front_.is_face(static_cast<size_t>(edge) >> 2) || front_.twin(edge) > edge)
                continue;
            int32_t a = front_.corner(edge), b = front_.corner(next_half_edge(edge));
            int32_t p = front_.parent(a), q = front_.parent(b);
            bool shared = p == q, split = coarse_.split(p) || coarse_.split(q);
            int faces = 0, uncovered = 0;
            if (shared) {
                faces = std::max(coarse_.child_count(p) - 2, 0);
            } else if (coarse_.crowded(p) || coarse_.crowded(q)) {
                auto see = [&](int32_t k) {
                    faces++;
                    uncovered += !coarse_.covered(k);
                    split = split || coarse_.split(coarse_.apex(k));
                };
                coarse_.each_between(p, q, see);
            }
            if (!split || faces == 0) continue;
            int32_t wanted = NONE;
            bool turned = false;
            if constexpr (Coder::encoding) {
                wanted = truth_.find(a, b);
                if (wanted < 0) wanted = truth_.find(b, a), turned = true;
            }
            bool border = front_.twin(edge) < 0;
            int borders = (front_.vertex(a).split >> 1) + (front_.vertex(b).split >> 1);
            auto place = static_cast<uint32_t>(
                (((shared * 6 + std::min(faces, 5)) * 3 + std::min(uncovered, 2)) * 3 + borders) * 4 + 2 * border +
                !(coarse_.split(p) && coarse_.split(q)));
            if (code(C::EXTRA + place, wanted >= 0) == 0) continue;
            turned = code(C::ESCAPE + 16 + border, turned) != 0;
            int32_t first = turned ? b : a, second = turned ? a : b;
            gather_all(edge, first, second, false);
            int32_t apex = code_apex(first, second, Coder::encoding ? truth_.vertex(wanted, 2) : NONE);
            if constexpr (Coder::encoding) truth_.mark_coded(wanted);
            add_loose(first, second, apex);
            had_extra_ = true;
            return true;
        }
        return false;
    }

    bool next_seed(int32_t& seed) {
        auto faces = static_cast<int32_t>(coarse_.face_count());
        while (seed < faces && coarse_.covered(4 * seed)) seed++;
        return seed < faces;
    }
    // The face above a coarse face that is not covered: three corners, nearest first.
    void code_seed(int32_t seed) {
        int32_t wanted = NONE, above[3], corners[3] = {NONE, NONE, NONE};
        for (int k = 0; k < 3; k++) above[k] = coarse_.origin(4 * seed + k);
        if constexpr (Coder::encoding) {
            wanted = truth_.find_above(static_cast<uint32_t>(above[0]), static_cast<uint32_t>(above[1]),
                                       static_cast<uint32_t>(above[2]));
            if (wanted < 0 && traits_.clean) {
                unclean_ = true;
                return;
            }
        }
        coarse_.cover(4 * seed);
        if (!traits_.clean && code(C::SEED, wanted >= 0) == 0) return;
        for (int k = 0; k < 3; k++) {
            int32_t base = coarse_.first_child(above[k]), size = coarse_.child_count(above[k]);
            int32_t want = Coder::encoding ? truth_.vertex(wanted, k) : NONE;
            corners[k] = size > 256 ? base + code_place(size, want - base) : code_nearest(base, size, k, corners, want);
        }
        if constexpr (Coder::encoding) truth_.mark_coded(wanted);
        add_loose(corners[0], corners[1], corners[2]);
    }
    int32_t code_place(int32_t size, int32_t place) {
        int bits = 32 - std::countl_zero(static_cast<uint32_t>(size - 1));
        auto found = decisions_.code_raw_number(bits, place);
        expect(found < size, "a corner that is none");
        return found;
    }
    int32_t code_nearest(int32_t base, int32_t size, int known, const int32_t* corners, int32_t want) {
        float distances[256];
        for (int32_t i = 0; i < size; i++) {
            int32_t v = base + i;
            float distance = 0;
            for (int j = 0; j < known; j++) {
                if (sighted) {
                    F32x4 way = front_.position(v) - front_.position(corners[j]);
                    distance += dot3(way, way);
                } else {
                    distance += static_cast<float>(std::abs(v - corners[j]));
                }
            }
            distances[i] = front_.vertex(v).degree != 0 ? distance * 2 + 1 : distance;
        }
        for (int32_t turn = 0; turn < size - 1; turn++) {
            auto best = static_cast<int32_t>(std::min_element(distances, distances + size) - distances);
            auto place = static_cast<uint32_t>(8 * known + std::min(turn, 7));
            if (code(C::SEED + 8 + place, base + best == want) != 0) return base + best;
            distances[best] = 3e38f;
        }
        return base + static_cast<int32_t>(std::min_element(distances, distances + size) - distances);
    }

    // A face by its corners' numbers.
    void code_leftover() {
        int32_t wanted = NONE, corners[3] = {0, 0, 0};
        if constexpr (Coder::encoding) {
            wanted = truth_.find_any();
            expect(wanted >= 0, "faces that are coded twice");
            for (int k = 0; k < 3; k++) corners[k] = truth_.vertex(wanted, k);
            truth_.mark_coded(wanted);
        }
        auto n = static_cast<int32_t>(fine_.parents.size());
        corners[0] = last_leftover_ + decisions_.code_number(1, corners[0] - last_leftover_);
        expect(corners[0] >= 0 && corners[0] < n, "a corner that is none");
        last_leftover_ = corners[0];
        corners[1] = code_vertex(2, corners[0], corners[1], NONE);
        corners[2] = code_vertex(3, corners[0], corners[2], corners[1]);
        add_loose(corners[0], corners[1], corners[2]);
    }

    const Level& coarse_level_;
    Level& fine_;
    FacesMemory& memory_;
    FacesTraits traits_;
    Front front_;
    CoarseFaces coarse_;
    Candidates<effort, positions> candidates_;
    FacesDecisions<effort, positions, Coder> decisions_;
    TruthIndex& truth_;
    float unit_ = 1;
    size_t later_next_ = 0, within_next_ = 0;
    bool unclean_ = false, unanswered_ = false, had_extra_ = false; // what an encoder finds
    int32_t last_leftover_ = 0;

public:
    void set_unit(float unit) { unit_ = unit; }
};

} // namespace meshtide::inline MESHTIDE_ISA
