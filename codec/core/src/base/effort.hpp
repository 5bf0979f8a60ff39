// How much work a profile's layers put into their predictions.
//
// Both efforts are one walk; they differ in contexts, geometry and the size of the mixer. A walk is a template: the
// compiler makes one of each effort, and what an effort does not have is not there. A third one, `either`, has what
// both have and asks at run time: that of the WebAssembly for all streams, which has to be fetched before it can run.
#pragma once

namespace meshtide {

enum class Effort { standard, high, either }; // "standard" is effort default, which C++ has as a keyword

// Of the layers that are at work; WebAssembly has no threads.
inline bool either_is_high = false;
inline bool either_sees_positions = true;

template <auto standard, auto high>
struct ByEffort {
    constexpr operator decltype(standard)() const { return either_is_high ? high : standard; }
};
template <auto blind, auto standard, auto high>
struct BySight {
    constexpr operator decltype(standard)() const {
        return !either_sees_positions ? blind : either_is_high ? high : standard;
    }
};

// What differs: a constant, or what is asked like one.
template <Effort effort, auto standard, auto high>
inline constexpr auto BY_EFFORT = ByEffort<standard, high>{};
template <auto standard, auto high>
inline constexpr auto BY_EFFORT<Effort::standard, standard, high> = standard;
template <auto standard, auto high>
inline constexpr auto BY_EFFORT<Effort::high, standard, high> = high;

template <Effort effort>
inline constexpr auto IS_HIGH = BY_EFFORT<effort, false, true>;

// How much room there has to be.
template <Effort effort, auto standard, auto high>
inline constexpr auto AT_MOST = effort == Effort::standard ? standard : high;

// Which streams a build decodes: all of them, or those of profile compact at effort default. A browser loads the other
// build only for a stream that this one refuses (Fault::unsupported, stream/header.cpp).
#ifdef MESHTIDE_DEFAULT_ONLY
inline constexpr bool DECODES_ALL = false;
#else
inline constexpr bool DECODES_ALL = true;
#endif

// What the layers of an effort are compiled as, and which they are from now on.
#if defined(__wasm__) && !defined(MESHTIDE_DEFAULT_ONLY)
template <Effort effort>
inline constexpr Effort COMPILED = Effort::either;
inline void choose(Effort effort, bool positions = true) {
    either_is_high = effort == Effort::high;
    either_sees_positions = positions;
}
#else
template <Effort effort>
inline constexpr Effort COMPILED = effort;
inline void choose(Effort, bool = true) {}
#endif

} // namespace meshtide
