// A self-check that needs no file: does the core compute the bits that streams rest on, on this machine?
#pragma once

#include "base/lanes.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Codes a made sequence with the mixer, with contexts and with numbers that come of float lanes, decodes it, and
// returns a digest of the bytes between; 0 if what was decoded differs.
uint64_t self_check();

} // namespace meshtide::inline MESHTIDE_ISA
