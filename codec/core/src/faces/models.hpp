// What the faces' decisions know: scores of candidates, contexts and weights. They go on from level to level.
#pragma once

#include "entropy/layer_model.hpp"
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
struct FacesModel : LayerModel {
    using Places = ScorePlaces<effort, positions>;
    static constexpr auto high = FacesAsk<effort, positions>::high;
    using DecisionMixer = EffortMixer<positions ? effort : Effort::standard, FixedShape<1, 3, 4>, FixedShape<5, 4, 5>>;

    explicit FacesModel(Budget& budget)
        : LayerModel(budget,
                     {FacesContexts::COUNT + (high ? 9 * static_cast<size_t>(Places::COUNT) : 0), FacesNeurons::COUNT,
                      FacesNeurons::FINAL, static_cast<size_t>(DecisionMixer::lanes),
                      high ? WEIGHT_ONE / 16 : WEIGHT_ONE / 5, WEIGHT_ONE / DecisionMixer::neuron_count}),
          scores(budget) {
        scores.assign(static_cast<size_t>(Places::ROOM), 0);
    }

    void copy(const FacesModel& other) {
        scores.copy(other.scores.span());
        LayerModel::copy(other);
    }

    // At effort high more terms make a score, so each is coded more finely.
    template <class Coder>
    void code_states(Coder& coder, StatesModel& states) {
        constexpr uint16_t SETTLED_RATE = 65536 / 14;
        const int FINER = high ? 2 : 0;
        states.code_scores(coder, scores.span().part(0, static_cast<size_t>(Places::COUNT)), 8 - FINER);
        LayerModel::code_states(coder, states, {SETTLED_RATE, 9 - FINER, 9 - FINER});
    }

    Array<int16_t> scores;
};

} // namespace meshtide::inline MESHTIDE_ISA
