// What the tests of the core are written with: no framework, one plain program.
#pragma once

#include "base/failure.hpp"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <type_traits>

namespace meshtide::testing {

// Says where a check stands; the default arguments of the checks fill it in.
struct Place {
    const char* file = __builtin_FILE();
    int line = __builtin_LINE();
};

inline void check(bool holds, Place place = {}) {
    if (holds) return;
    std::printf("%s:%d: does not hold\n", place.file, place.line);
    std::exit(1);
}

template <class A, class B>
void check_equal(const A& found, const B& expected, Place place = {}) {
    if (found == static_cast<A>(expected)) return;
    std::printf("%s:%d: found %lld (%#llx), expected %lld (%#llx)\n", place.file, place.line,
                static_cast<long long>(found), static_cast<unsigned long long>(found), static_cast<long long>(expected),
                static_cast<unsigned long long>(expected));
    std::exit(1);
}

// How many bodies failed as they must.
inline int failures_seen = 0;

#ifdef __wasm__
// In WebAssembly a failure traps. tests/run_wasm.mjs calls the body, and answers with the fault that ended it, or 0.
__attribute__((import_module("tests"), import_name("attempt"))) int attempt(void (*call)(void*), void* body);
#endif

// Holds if the body fails, as the fault that is named.
template <class Body>
void check_fails(Fault fault, Body&& body, Place place = {}) {
    int told = 0;
#ifdef __wasm__
    told = attempt([](void* given) { (*static_cast<std::remove_reference_t<Body>*>(given))(); }, &body);
#else
    try {
        body();
    } catch (const Failure& failure) {
        told = static_cast<int>(failure.fault);
    }
#endif
    check_equal(told, static_cast<int>(fault), place);
    failures_seen++;
}

// D. Lehmer's generator modulo 2^64, with M. O'Neill's multiplier; the upper bits are used.
struct Numbers {
    uint64_t state = 0x2545f4914f6cdd1d;
    uint32_t below(uint32_t limit) {
        state *= 0xda942042e4dd58b5;
        return static_cast<uint32_t>((state >> 32) * limit >> 32);
    }
    int between(int least, int greatest) {
        return least + static_cast<int>(below(static_cast<uint32_t>(greatest - least + 1)));
    }
};

// G. Fowler, L. C. Noll, K.-P. Vo, 1a.
struct Digest {
    uint64_t value = 0xcbf29ce484222325;
    void add(const void* bytes, size_t count) {
        for (size_t i = 0; i < count; i++) value = (value ^ static_cast<const uint8_t*>(bytes)[i]) * 0x100000001b3;
    }
};

} // namespace meshtide::testing
