#include "diff/plane.hpp"

namespace meshtide::inline MESHTIDE_ISA {

template void code_diff(RangeEncoder&, int, DiffSlice&, DiffModel<Effort::standard>&, const DiffTruth&);
template void code_diff(RangeDecoder&, int, DiffSlice&, DiffModel<Effort::standard>&, const DiffTruth&);
#ifdef __wasm__
template void code_diff(RangeEncoder&, int, DiffSlice&, DiffModel<Effort::either>&, const DiffTruth&);
template void code_diff(RangeDecoder&, int, DiffSlice&, DiffModel<Effort::either>&, const DiffTruth&);
#endif
template void code_diff(RangeEncoder&, int, DiffSlice&, DiffModel<Effort::high>&, const DiffTruth&);
template void code_diff(RangeDecoder&, int, DiffSlice&, DiffModel<Effort::high>&, const DiffTruth&);

} // namespace meshtide::inline MESHTIDE_ISA
