// How the core says that it cannot go on.
//
// Natively a failure is thrown and caught at the C interface, which turns it into an error code. WebAssembly is built
// without exceptions: there a failure is noted and the instance traps, and its host reads the note.
#pragma once

#include <cstdint>

namespace meshtide {

// What kind of failure it is; the C interface and every binding have the same numbers.
enum class Fault : int32_t {
    none = 0,
    malformed = 1, // the stream holds what no encoder writes
    limit = 2,     // more than the caller allowed
    memory = 3,    // the system has no memory left
    argument = 4,  // the caller broke the contract of a function
    internal = 5,  // a bug: an access that its own checks should have excluded
};

struct Failure {
    Fault fault;
    const char* text; // a literal
};

[[noreturn]] void fail(Fault fault, const char* text);

// Fails as malformed unless the condition holds.
inline void expect(bool condition, const char* text) {
    if (!condition) [[unlikely]]
        fail(Fault::malformed, text);
}

} // namespace meshtide
