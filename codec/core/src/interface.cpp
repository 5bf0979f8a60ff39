// The C interface (include/meshtide.h): what goes through it is checked here, and what fails behind it ends here.
#include "base/failure.hpp"
#include "base/processor.hpp"
#include "meshtide.h"
#include "self_check.hpp"

#include <new>

#ifndef MESHTIDE_SOURCES
#define MESHTIDE_SOURCES ""
#endif

namespace meshtide {
namespace {

// Runs what a function of the interface is for. In WebAssembly, which has no exceptions here, a failure does not come
// back: it ends the instance (base/failure.cpp).
template <class Body>
Failure guarded(Body&& body) {
#ifdef __wasm__
    body();
#else
    try {
        body();
    } catch (const Failure& failure) {
        return failure;
    } catch (const std::bad_alloc&) {
        return {Fault::memory, "the system has no memory left"};
    }
#endif
    return {Fault::none, ""};
}

} // namespace
} // namespace meshtide

extern "C" {

const char* mt_kind(void) { return meshtide::KIND; }
const char* mt_best_kind(void) { return meshtide::best_kind(); }
const char* mt_sources(void) { return MESHTIDE_SOURCES; }

uint64_t mt_self_check(void) {
    uint64_t digest = 0;
    meshtide::Failure failure = meshtide::guarded([&] { digest = meshtide::self_check(); });
    return failure.fault == meshtide::Fault::none ? digest : 0;
}

} // extern "C"
