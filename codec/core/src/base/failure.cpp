#include "base/failure.hpp"

#ifdef __wasm__

namespace meshtide {

extern "C" {
Failure mt_last_failure = {Fault::none, ""};
}

void fail(const Failure& failure) {
    mt_last_failure = failure;
    __builtin_trap();
}

} // namespace meshtide

#else

namespace meshtide {

void fail(const Failure& failure) { throw failure; }

} // namespace meshtide

#endif

namespace meshtide {

void fail(Fault fault, const char* text) { fail(Failure{fault, text}); }

void fail_access() { fail(Fault::internal, "an access outside of an array"); }

} // namespace meshtide
