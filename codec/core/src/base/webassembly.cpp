// What the C++ library of WebAssembly calls when it cannot go on; its own version prints, which would ask the host for
// files. A browser's core imports nothing.
#ifdef __wasm__

#include <cstddef>

namespace std {
inline namespace __1 {

[[noreturn]] void __libcpp_verbose_abort(const char*, ...) noexcept { __builtin_trap(); }

} // namespace __1
} // namespace std

#endif
