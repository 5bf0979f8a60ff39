// What is inlined, and where.
#pragma once

#define MESHTIDE_INLINE inline __attribute__((always_inline))

// What is large and called from several places: a copy for each of them where only speed counts, one in WebAssembly,
// which has to be fetched before it can run.
#ifdef __wasm__
#define MESHTIDE_ONCE inline __attribute__((noinline))
#else
#define MESHTIDE_ONCE MESHTIDE_INLINE
#endif
