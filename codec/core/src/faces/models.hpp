// What the faces' decisions know: scores of candidates, contexts and weights. They go on from level to level.
#pragma once

#include "entropy/mixing.hpp"
#include "entropy/states.hpp"
#include "faces/candidates.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr int PICK_TURNS = 4, ODDS = 32;

// Contexts of "is it this one?" (mixed), of "has the gate a face?" (mixed), and of rare decisions.
struct FacesContexts {
    static constexpr uint32_t PICK_BY_ODDS = 0;
    static constexpr uint32_t PICK_BY_LEFT = PICK_BY_ODDS + PICK_TURNS * ODDS * CORNERS;
    static constexpr uint32_t PICK_BY_RIVAL = PICK_BY_LEFT + 2 * 4 * ODDS * 16;
    static constexpr uint32_t PICK_BY_SHAPE = PICK_BY_RIVAL + 8 * CORNERS * CORNERS;
    static constexpr uint32_t GATE = PICK_BY_SHAPE + 2 * 256 * CORNERS;
    static constexpr uint32_t GATE_BY_SCORE = GATE + 504;
    static constexpr uint32_t GATE_BY_CORNER = GATE_BY_SCORE + ODDS * 21;
    static constexpr uint32_t GATE_BY_ODDS = GATE_BY_CORNER + 12 * CORNERS;
    static constexpr uint32_t HOLE = GATE_BY_ODDS + ODDS * 21;
    static constexpr uint32_t ESCAPE = HOLE + 16;
    static constexpr uint32_t EXTRA = ESCAPE + 64;
    static constexpr uint32_t SEED = EXTRA + 512;
    static constexpr uint32_t NUMBERS = SEED + 64;
    static constexpr uint32_t COUNT = NUMBERS + 6 * SIGNED_CONTEXTS;
};
struct FacesNeurons {
    static constexpr uint32_t PICK_TURN = 0;
    static constexpr uint32_t PICK_CORNER = PICK_TURN + 16;
    static constexpr uint32_t PICK_ODDS = PICK_CORNER + CORNERS;
    static constexpr uint32_t GATE_FAMILY = PICK_ODDS + ODDS;
    static constexpr uint32_t GATE_CORNER = GATE_FAMILY + 64;
    static constexpr uint32_t GATE_ODDS = GATE_CORNER + CORNERS;
    static constexpr uint32_t PICK_MARGIN = GATE_ODDS + ODDS; // high only, as the next
    static constexpr uint32_t GATE_SCORE = PICK_MARGIN + 32;
    static constexpr uint32_t COUNT = GATE_SCORE + 32;
    static constexpr uint32_t FINAL = 16;
};

template <Effort effort, bool positions>
struct FacesModel {
    static constexpr auto high = FacesAsk<effort, positions>::high;
    using DecisionMixer = EffortMixer<positions ? effort : Effort::standard, FixedShape<1, 3, 4>, FixedShape<5, 4, 5>>;

    explicit FacesModel(Budget& budget) : scores(budget), contexts(budget), weights(budget), final_weights(budget) {
        scores.assign(static_cast<size_t>(ScorePlaces<effort, positions>::ROOM), 0);
        const auto lanes = static_cast<size_t>(DecisionMixer::lanes);
        contexts.assign(FacesContexts::COUNT +
                            (high ? 9 * static_cast<size_t>(ScorePlaces<effort, positions>::COUNT) : 0),
                        Context{});
        weights.assign(FacesNeurons::COUNT * lanes, 0);
        for (size_t j = 0; j < FacesNeurons::COUNT; j++)
            for (size_t i = 0; i + 8 < lanes; i++)
                if ((i & 4) == 0) weights[j * lanes + i] = high ? WEIGHT_ONE / 16 : WEIGHT_ONE / 5;
        final_weights.assign(FacesNeurons::FINAL * 8, static_cast<int16_t>(WEIGHT_ONE / DecisionMixer::neuron_count));
    }

    void copy(const FacesModel& other) {
        scores.copy(other.scores.span());
        contexts.copy(other.contexts.span());
        weights.copy(other.weights.span());
        final_weights.copy(other.final_weights.span());
    }
    MixerStates mixer_states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    // Its trained states. At effort high more terms make a score, so each is told more finely.
    template <class Coder>
    void code_states(Coder& coder, StatesModel& states) {
        constexpr uint16_t SETTLED_RATE = 65536 / 14;
        const int FINER = high ? 2 : 0;
        states.code_scores(coder, scores.span().part(0, static_cast<size_t>(ScorePlaces<effort, positions>::COUNT)),
                           8 - FINER);
        states.code_contexts(coder, contexts.span(), SETTLED_RATE);
        states.code_weights(coder, weights.span(), static_cast<size_t>(DecisionMixer::lanes), 9 - FINER);
        states.code_weights(coder, final_weights.span(), 8, 9 - FINER);
    }

    Array<int16_t> scores;
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
};

} // namespace meshtide::inline MESHTIDE_ISA
