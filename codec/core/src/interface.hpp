// What the sources of the C interface share: failures become errors, and arguments are checked.
#pragma once

#include "codec/stream_decoder.hpp"
#include "meshtide.h"

#include <new>

struct mt_states {
    mt_states() : budget(UINT64_MAX) {}
    meshtide::Budget budget;
    meshtide::Trained trained;
};

namespace meshtide {

// Fills an error; `place` is of the packet that the failure is about, or null.
void fill_error(mt_error* error, const Failure& failure, const PacketPlace* place);

// Runs something that may fail. In WebAssembly a failure ends the instance, and its host reads mt_last_failure, see
// base/failure.cpp.
template <class Work>
int32_t guarded(mt_error* error, Work work, const PacketPlace* place = nullptr) {
#ifdef __wasm__
    (void)error, (void)place;
    work();
    return MT_OK;
#else
    try {
        work();
        return MT_OK;
    } catch (const Failure& failure) {
        fill_error(error, failure, place);
        return static_cast<int32_t>(failure.fault);
    } catch (const std::bad_alloc&) {
        fill_error(error, {Fault::memory, "the system has no memory left"}, place);
        return MT_MEMORY;
    }
#endif
}

template <class T>
Span<const T> lent(const T* data, uint64_t count) {
    return {data, checked_size(count)};
}

} // namespace meshtide
