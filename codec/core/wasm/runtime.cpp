// What compiled code expects to be there: memory, and little else. WebAssembly without any library imports nothing.
//
// Memory comes in blocks of 32 bytes times a power of two, the first 16 of which hold how many; what is given back is
// kept in a list for each size (D. E. Knuth, "The Art of Computer Programming", volume 1, 2.5, without buddies: an
// instance of the core lives as long as a stream or two).
#include "base/failure.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>

extern "C" unsigned char __heap_base; // behind the stack and the data, by the linker

namespace {

constexpr size_t HEAD = 16, PAGE = 1 << 16;
constexpr int SIZES = 26;

union Block {
    int size;    // in front of what is in use
    Block* next; // of those that are not
};
Block* freed[SIZES];
size_t unused = 0; // the first address that was never in use

size_t room_of(int size) { return (static_cast<size_t>(32) << size) - HEAD; }
Block* head_of(void* memory) { return reinterpret_cast<Block*>(static_cast<unsigned char*>(memory) - HEAD); }

} // namespace

extern "C" {

void* malloc(size_t bytes) {
    if (bytes > room_of(SIZES - 1)) return nullptr;
    int size = static_cast<int>(std::bit_width((bytes + HEAD - 1) >> 5));
    Block* block = freed[size];
    if (block != nullptr) {
        freed[size] = block->next;
    } else {
        if (unused == 0) unused = (reinterpret_cast<size_t>(&__heap_base) + HEAD - 1) / HEAD * HEAD;
        size_t end = unused + HEAD + room_of(size), pages = __builtin_wasm_memory_size(0);
        size_t needed = end / PAGE + 1;
        if (end < unused) return nullptr;
        if (needed > pages && __builtin_wasm_memory_grow(0, needed - pages) == SIZE_MAX) return nullptr;
        block = reinterpret_cast<Block*>(unused);
        unused = end;
    }
    block->size = size;
    return reinterpret_cast<unsigned char*>(block) + HEAD;
}

void free(void* memory) {
    if (memory == nullptr) return;
    Block* block = head_of(memory);
    int size = block->size;
    block->next = freed[size];
    freed[size] = block;
}

void* realloc(void* memory, size_t bytes) {
    size_t room = memory == nullptr ? 0 : room_of(head_of(memory)->size);
    if (memory != nullptr && bytes <= room) return memory;
    void* moved = malloc(bytes);
    if (moved == nullptr) return nullptr;
    if (memory != nullptr) std::memcpy(moved, memory, room);
    free(memory);
    return moved;
}

// To be called once, before anything else.
void __wasm_call_ctors();
__attribute__((export_name("_initialize"))) void initialize() { __wasm_call_ctors(); }

[[noreturn]] void __cxa_pure_virtual() { __builtin_trap(); }

} // extern "C"

void* operator new(size_t bytes) {
    void* made = malloc(bytes);
    if (made == nullptr) meshtide::fail(meshtide::Fault::memory, "the system has no memory left");
    return made;
}
void* operator new(size_t bytes, const std::nothrow_t&) noexcept { return malloc(bytes); }
void operator delete(void* memory) noexcept { free(memory); }
void operator delete(void* memory, size_t) noexcept { free(memory); }
const std::nothrow_t std::nothrow{};
