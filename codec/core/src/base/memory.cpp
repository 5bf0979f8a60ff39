#include "base/memory.hpp"

#include <algorithm>

#ifdef __linux__
#include <sys/mman.h>
#endif
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace meshtide {

#ifdef __linux__

namespace {

constexpr size_t MANY = 4 << 20; // bytes

bool is_mapped(size_t size) { return size >= MANY; }

void* new_bytes(size_t size) {
    if (!is_mapped(size)) return std::malloc(size);
    void* made = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return made == MAP_FAILED ? nullptr : made;
}

void free_bytes(void* bytes, size_t size) {
    if (is_mapped(size))
        munmap(bytes, size);
    else
        std::free(bytes);
}

} // namespace

void* moved_bytes(void* bytes, size_t before, size_t after) {
    if (before != 0 && after != 0 && is_mapped(before) == is_mapped(after)) {
        if (!is_mapped(before)) return std::realloc(bytes, after);
        void* moved = mremap(bytes, before, after, MREMAP_MAYMOVE);
        return moved == MAP_FAILED ? nullptr : moved;
    }
    void* moved = after == 0 ? nullptr : new_bytes(after);
    if (after != 0 && moved == nullptr) return nullptr;
    if (before != 0 && after != 0) std::memcpy(moved, bytes, std::min(before, after));
    if (before != 0) free_bytes(bytes, before);
    return moved;
}

#else

void* moved_bytes(void* bytes, size_t before, size_t after) {
    (void)before;
    if (after != 0) return std::realloc(bytes, after);
    std::free(bytes);
    return nullptr;
}

#endif

void trim_heap() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

void add_up(Span<uint32_t> counts) {
    uint32_t sum = 0;
    for (uint32_t& count : counts) count = sum += count;
}

ArrayBytes::~ArrayBytes() { give_back(); }

void ArrayBytes::give_back() {
    if (data_ == nullptr) return;
    moved_bytes(data_, static_cast<size_t>(room_bytes_), 0);
    budget_->give_back(room_bytes_);
    data_ = nullptr;
    size_ = room_ = 0;
    room_bytes_ = 0;
}

ArrayBytes::ArrayBytes(Budget& budget) : budget_(&budget) {}

void ArrayBytes::swap(ArrayBytes& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(room_, other.room_);
    std::swap(room_bytes_, other.room_bytes_);
}

void ArrayBytes::resize(size_t size, size_t bytes) {
    if (size > room_) enlarge(size, bytes);
    size_ = size;
}

void ArrayBytes::fill(size_t size, const void* value, size_t bytes) {
    size_t old = size_;
    resize(size, bytes);
    if (size <= old) return;
    // Copies of what is there already: one, two, four, ...
    char* first = static_cast<char*>(data_) + old * bytes;
    size_t done = bytes, all = (size - old) * bytes;
    std::memcpy(first, value, bytes);
    for (; done < all - done; done *= 2) std::memcpy(first + done, first, done);
    std::memcpy(first + done, first, all - done);
}

void ArrayBytes::copy(const void* data, size_t size, size_t bytes) {
    renew(size, bytes);
    if (size != 0) std::memcpy(data_, data, size * bytes);
}

void ArrayBytes::enlarge(size_t room, size_t bytes) {
    if (room > SIZE_MAX / bytes) fail(Fault::limit, "more elements than memory can have");
    uint64_t wanted = static_cast<uint64_t>(room) * bytes;
    if (size_ == 0) give_back();
    budget_->take(wanted - room_bytes_);
    void* moved = moved_bytes(data_, static_cast<size_t>(room_bytes_), room * bytes);
    if (moved == nullptr) [[unlikely]] {
        budget_->give_back(wanted - room_bytes_);
        fail(Fault::memory, "the system has no memory left");
    }
    data_ = moved;
    room_ = room;
    room_bytes_ = wanted;
}

} // namespace meshtide
