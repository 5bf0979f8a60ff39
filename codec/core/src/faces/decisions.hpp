// The mixed decisions at a gate: has it a face, and which candidate is its apex?
#pragma once

#include "faces/models.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// What is known of a gate before its candidates are.
struct GateKind {
    uint32_t family;  // 0 within a cell, 1 the same, by cells around; 2 no coarse face ahead, 3 one without an image, 4
                      // one with; 5 those that are blocked, 6 the same within a cell
    uint32_t borders; // ends where a gate was found to have no face
    uint32_t split;   // has one of the ends siblings?
};

template <Effort effort, bool positions, class Coder>
class FacesDecisions {
    using Model = FacesModel<effort, positions>;
    using C = FacesContexts;
    using N = FacesNeurons;
    static constexpr auto high = FacesAsk<effort, positions>::high;
    static constexpr auto sighted = FacesAsk<effort, positions>::sighted;

public:
    FacesDecisions(Coder& coder, Model& model, Candidates<effort, positions>& candidates)
        : coder_(coder), contexts_(model.contexts.span()), mixer_(model.mixer_states()), candidates_(candidates) {}

    // A decision by one context.
    int code(uint32_t place, bool bit) { return code_bit(coder_, contexts_[place], bit ? 1 : 0); }
    // A signed number; each kind has its own contexts.
    int32_t code_number(uint32_t which, int32_t value) {
        return code_signed(coder_, contexts_.part(C::NUMBERS + which * SIGNED_CONTEXTS, SIGNED_CONTEXTS), value);
    }
    int32_t code_raw_number(int bits, int32_t value) {
        return static_cast<int32_t>(code_raw(coder_, bits, static_cast<uint32_t>(value)));
    }

    // Has the gate a face, with one of the candidates, of which this is the best?
    int code_has_face(GateKind gate, int best, bool wanted) {
        typename Model::DecisionMixer::Question question;
        uint32_t family = gate.family, borders = gate.borders;
        auto corner = static_cast<uint32_t>(candidates_.corner_of[best]);
        uint32_t closes = corner >> 1 & 3, z = closes == 3 ? 2 : closes != 0;
        auto count = static_cast<uint32_t>(std::min(candidates_.count - 1, 3));
        uint32_t place = C::GATE + (((family * 3 + borders) * 3 + z) * 4 + count) * 2 + gate.split;
        auto score = static_cast<uint32_t>(std::clamp((candidates_.score_of[best] >> 7) + 16, 0, 31));
        int odds = odds_of(best);
        auto odds_place = static_cast<uint32_t>(odds_class(odds));
        store(question.contexts, U32x4{place, C::GATE_BY_SCORE + (score * 7 + family) * 3 + borders,
                                       C::GATE_BY_CORNER + (corner * 3 + borders) * 4 + count,
                                       C::GATE_BY_ODDS + (odds_place * 7 + family) * 3 + borders});
        question.opposed[0] = splat16(0);
        auto number = static_cast<int16_t>(std::clamp(odds * 177 >> 8, -2047, 2047));
        auto height = static_cast<int16_t>(std::clamp(candidates_.score_of[best] * 177 >> 8, -2047, 2047));
        question.numbers = I16x8{256, number, height, 0, 0, 0, 0, 0};
        store(question.neurons, U32x4{N::GATE_FAMILY + (family * 3 + borders) * 3 + z, N::GATE_CORNER + corner,
                                      N::GATE_ODDS + odds_place, high ? N::GATE_SCORE + score : 0});
        question.final_neuron = 8 + family;
        if constexpr (effort != Effort::standard)
            if (high)
                add_places(question, C::COUNT + 8 * static_cast<uint32_t>(Candidates<effort, positions>::Places::COUNT),
                           best, {1, 0});
        return mixer_.code(coder_, question, wanted);
    }

    // Which candidate it is, as a lane. top: the best ones; want: the one that it is (encoder).
    int choose(typename Candidates<effort, positions>::Best top, int want, bool learning) {
        auto [best, rival] = top;
        float weights[LANES], total = candidates_.total;
        bool many = candidates_.count > 1;
        bool doubtful = learning && many;
        if (doubtful)
            for (int i = 0; i < candidates_.lanes; i += 4) store(weights + i, load<F32x4>(candidates_.weight_of + i));
        if constexpr (requires { coder_.watch(candidates_, want); })
            if (many && learning) coder_.watch(candidates_, want);
        int turn = 0;
        while (candidates_.count > 1 && code_is_it(best, rival, turn, want == best) == 0) {
            candidates_.drop(best);
            turn++;
            auto next = candidates_.find_best();
            best = next.best, rival = next.rival;
        }
        if (doubtful && weights[best] * 8 < total * (high ? 7.9f : 7)) candidates_.learn(best, total, weights);
        return best;
    }

private:
    int code_is_it(int best, int rival, int turn, bool is) {
        typename Model::DecisionMixer::Question question;
        auto corner = static_cast<uint32_t>(candidates_.corner_of[best]);
        auto other = static_cast<uint32_t>(candidates_.corner_of[rival]);
        int odds = odds_of(best);
        auto odds_place = static_cast<uint32_t>(odds_class(odds));
        auto t = static_cast<uint32_t>(std::min(turn, 3)), again = static_cast<uint32_t>(turn > 0);
        auto left = static_cast<uint32_t>(std::min(candidates_.count - 2, 3));
        int margin = candidates_.score_of[best] - candidates_.score_of[rival];
        auto close = static_cast<uint32_t>(std::clamp(margin >> 7, 0, 15));
        uint32_t shape = corner;
        if (sighted) shape = static_cast<uint32_t>(candidates_.places_of[2][best]);
        store(question.contexts,
              U32x4{C::PICK_BY_ODDS + (t * ODDS + odds_place) * CORNERS + corner,
                    C::PICK_BY_LEFT + ((again * 4 + left) * ODDS + odds_place) * 16 + close,
                    C::PICK_BY_RIVAL + ((again * 4 + std::min(close >> 1, 3u)) * CORNERS + corner) * CORNERS + other,
                    C::PICK_BY_SHAPE + again * 256 * CORNERS + shape});
        question.opposed[0] = splat16(0);
        auto number = static_cast<int16_t>(std::clamp(odds * 177 >> 8, -2047, 2047));
        auto ahead = static_cast<int16_t>(std::clamp(margin * 177 >> 8, -2047, 2047));
        question.numbers = I16x8{256, number, ahead, 0, 0, 0, 0, 0};
        store(question.neurons, U32x4{N::PICK_TURN + 4 * t + left, N::PICK_CORNER + corner, N::PICK_ODDS + odds_place,
                                      high ? N::PICK_MARGIN + 16 * again + close : 0});
        question.final_neuron = t;
        if constexpr (effort != Effort::standard)
            if (high) add_places(question, C::COUNT, best, {8, 4 * again + (odds_place >> 3)});
        return mixer_.code(coder_, question, is);
    }

    struct PlaceKind {
        uint32_t stride, which; // contexts of each place, and which of them
    };
    // A context for each of a candidate's places.
    template <class Question>
    MESHTIDE_INLINE void add_places(Question& question, uint32_t from, int lane, PlaceKind kind) {
        for (int j = 0; j < 16; j++)
            question.contexts[4 + j] =
                from + kind.stride * static_cast<uint32_t>(candidates_.places_of[j][lane]) + kind.which;
        for (int g = 1; g < 5; g++) question.opposed[g] = splat16(0);
    }

    // The odds of a candidate against all the others: twice the logarithm, 0..31.
    static int odds_class(int odds) { return std::clamp((odds >> 7) + 10, 0, 31); }
    MESHTIDE_INLINE int odds_of(int lane) const {
        float weight = candidates_.weight_of[lane];
        float others = std::max(candidates_.total - weight, weight * 0.0001f);
        return logarithm(weight) - logarithm(others);
    }

    Coder& coder_;
    Span<Context> contexts_;
    typename Model::DecisionMixer mixer_;
    Candidates<effort, positions>& candidates_;
};

} // namespace meshtide::inline MESHTIDE_ISA
