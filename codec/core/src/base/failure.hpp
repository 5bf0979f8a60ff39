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
    malformed = 1,   // the stream holds what no encoder writes
    limit = 2,       // more than the caller allowed
    memory = 3,      // the system has no memory left
    argument = 4,    // the caller broke the contract of a function
    version = 5,     // the stream is of another format
    internal = 6,    // a bug: an access that its own checks should have excluded
    unsupported = 7, // the stream is sound, but this build lacks what decodes it (base/effort.hpp)
};

struct Failure {
    Fault fault;
    const char* text;     // a literal
    int64_t offset = -1;  // byte of the packet or the header, where it is known
    uint64_t claimed = 0; // of a limit that is exceeded: what is claimed,
    uint64_t allowed = 0; // and what may be
};

[[noreturn]] void fail(const Failure& failure);
[[noreturn]] void fail(Fault fault, const char* text);
// The failure of every check of a place in memory: so short a call that checks cost little room.
[[noreturn]] void fail_access();

// Fails as malformed unless the condition holds.
inline void expect(bool condition, const char* text) {
    if (!condition) [[unlikely]]
        fail(Fault::malformed, text);
}

// Fails unless the caller keeps the contract of a function.
inline void require(bool condition, const char* text) {
    if (!condition) fail(Fault::argument, text);
}

// Fails unless what a stream claims is allowed; the text names the limit.
inline void expect_at_most(uint64_t claimed, uint64_t allowed, const char* text) {
    if (claimed > allowed) [[unlikely]]
        fail(Failure{Fault::limit, text, -1, claimed, allowed});
}

} // namespace meshtide
