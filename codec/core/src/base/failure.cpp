#include "base/failure.hpp"

#ifdef __wasm__

namespace meshtide {

extern "C" {
Failure mt_last_failure = {Fault::none, ""};
}

void fail(Fault fault, const char* text) {
    mt_last_failure = {fault, text};
    __builtin_trap();
}

} // namespace meshtide

#else

namespace meshtide {

void fail(Fault fault, const char* text) { throw Failure{fault, text}; }

} // namespace meshtide

#endif
