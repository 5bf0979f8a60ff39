/* The C interface of the core: the only door to it, for Python (ctypes), browsers (WebAssembly) and everybody else.
 *
 * Texts that a function returns are literals: they end with a zero byte and stay where they are.
 */
#ifndef MESHTIDE_H
#define MESHTIDE_H

#include <stdint.h>

#if defined(_WIN32)
#define MT_API __declspec(dllexport)
#else
#define MT_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The kind of processor that this library was compiled for ("baseline", "avx2"), and the best kind that runs on this
 * machine. Every kind computes the same bits. A binding loads the baseline library, asks it, and loads the best one. */
MT_API const char* mt_kind(void);
MT_API const char* mt_best_kind(void);

/* The digest of the sources that this library was compiled from (CMakeLists.txt); empty in WebAssembly. */
MT_API const char* mt_sources(void);

/* Codes a made sequence with all the arithmetic that streams rest on, decodes it again and returns a digest of what was
 * written: MT_SELF_CHECK on every machine where the core works; 0 if the two differ or something failed. */
#define MT_SELF_CHECK UINT64_C(0x4e951ff4f459af78)
MT_API uint64_t mt_self_check(void);

#ifdef __cplusplus
}
#endif

#endif
