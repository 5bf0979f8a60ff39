#include "codec/effort_layers.hpp"

namespace meshtide::inline MESHTIDE_ISA {

std::unique_ptr<DecoderLayers> make_decoder_layers(Effort effort, Budget& budget, const Plan& plan,
                                                   Span<const uint64_t> starts) {
    if (effort == Effort::high) return std::make_unique<DecoderLayersOf<Effort::high>>(budget, plan, starts);
    return std::make_unique<DecoderLayersOf<Effort::standard>>(budget, plan, starts);
}

} // namespace meshtide::inline MESHTIDE_ISA
