// Kinds of processors: which one this library was compiled for, and which one it runs on.
#pragma once

#include "base/lanes.hpp"

namespace meshtide::inline MESHTIDE_ISA {

#define MESHTIDE_TEXT(name) #name
#define MESHTIDE_TEXT_OF(name) MESHTIDE_TEXT(name)
constexpr const char* KIND = MESHTIDE_TEXT_OF(MESHTIDE_ISA);
#undef MESHTIDE_TEXT_OF
#undef MESHTIDE_TEXT

// The best kind that there is a library of, and that this processor and its system can run.
const char* best_kind();

} // namespace meshtide::inline MESHTIDE_ISA
