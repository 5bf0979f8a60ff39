// Memory that is asked for before it is taken, and read only where it is.
//
// A Budget knows how many bytes its owner may hold; an Array takes its bytes from one and gives them back; a Span looks
// at the elements of an array. Every access is checked, in release builds too: what a stream says about places in
// memory can be wrong in ways that no other check foresees, and then it ends in a Failure.
#pragma once

#include "base/failure.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <utility>

namespace meshtide {

// A count that a stream or a caller tells, as one of elements in memory.
inline size_t checked_size(uint64_t count) {
    if (count > SIZE_MAX) [[unlikely]]
        fail(Fault::limit, "more elements than memory can have");
    return static_cast<size_t>(count);
}

// How many bytes may still be taken.
class Budget {
public:
    explicit Budget(uint64_t bytes) : left_(bytes) {}
    Budget(const Budget&) = delete;
    Budget& operator=(const Budget&) = delete;

    void take(uint64_t bytes) {
        if (bytes > left_) [[unlikely]]
            fail(Fault::limit, "more memory than the limits allow");
        left_ -= bytes;
        if (taken() > peak_) peak_ = taken();
    }
    void give_back(uint64_t bytes) { left_ += bytes; }
    uint64_t left() const { return left_; }
    uint64_t peak() const { return peak_; }

private:
    uint64_t taken() const { return start_ - left_; }

    uint64_t left_;
    uint64_t start_ = left_;
    uint64_t peak_ = 0;
};

// Elements that somebody else owns.
template <class T>
class Span {
public:
    Span() = default;
    Span(T* data, size_t size) : data_(data), size_(size) {}
    operator Span<const T>() const { return {data_, size_}; }

    T& operator[](size_t index) const {
        if (index >= size_) [[unlikely]]
            fail(Fault::internal, "an access outside of an array");
        return data_[index];
    }
    // `count` elements from `first` on, for code that goes over them in vectors.
    T* block(size_t first, size_t count) const {
        if (first > size_ || count > size_ - first) [[unlikely]]
            fail(Fault::internal, "an access outside of an array");
        return data_ + first;
    }
    Span part(size_t first, size_t count) const { return {block(first, count), count}; }

    size_t size() const { return size_; }
    T* begin() const { return data_; }
    T* end() const { return data_ + size_; }

private:
    T* data_ = nullptr;
    size_t size_ = 0;
};

// Elements of its own, which can be copied as bytes. It grows by half of itself when it is pushed to, and keeps what it
// has taken when it shrinks: the arrays of one level serve the next.
template <class T>
class Array {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    explicit Array(Budget& budget) : budget_(&budget) {}
    Array(Array&& other) noexcept { swap(other); }
    Array& operator=(Array&& other) noexcept {
        swap(other);
        return *this;
    }
    Array(const Array&) = delete;
    Array& operator=(const Array&) = delete;
    ~Array() { release(); }

    void swap(Array& other) noexcept {
        std::swap(budget_, other.budget_);
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(room_, other.room_);
    }

    T& operator[](size_t index) {
        if (index >= size_) [[unlikely]]
            fail(Fault::internal, "an access outside of an array");
        return data_[index];
    }
    const T& operator[](size_t index) const {
        if (index >= size_) [[unlikely]]
            fail(Fault::internal, "an access outside of an array");
        return data_[index];
    }

    Span<T> span() { return {data_, size_}; }
    Span<const T> span() const { return {data_, size_}; }
    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    T* begin() { return data_; }
    T* end() { return data_ + size_; }
    const T* begin() const { return data_; }
    const T* end() const { return data_ + size_; }
    T& back() { return (*this)[size_ - 1]; }
    const T& back() const { return (*this)[size_ - 1]; }

    // Room for so many elements; what is there stays.
    void reserve(size_t room) {
        if (room <= room_) return;
        if (room > SIZE_MAX / sizeof(T)) fail(Fault::limit, "more elements than memory can have");
        budget_->take((room - room_) * sizeof(T));
        void* moved = std::realloc(static_cast<void*>(data_), room * sizeof(T));
        if (moved == nullptr) [[unlikely]] {
            budget_->give_back((room - room_) * sizeof(T));
            fail(Fault::memory, "the system has no memory left");
        }
        data_ = static_cast<T*>(moved);
        room_ = room;
    }
    // So many elements; new ones hold anything.
    void resize(size_t size) {
        reserve(size);
        size_ = size;
    }
    void resize(size_t size, const T& value) {
        size_t old = size_;
        resize(size);
        for (size_t i = old; i < size; i++) data_[i] = value;
    }
    // So many elements, all of this value.
    void assign(size_t size, const T& value) {
        size_ = 0;
        resize(size, value);
    }
    void copy(Span<const T> other) {
        resize(other.size());
        if (size_ != 0) std::memcpy(static_cast<void*>(data_), other.begin(), size_ * sizeof(T));
    }
    void push(const T& value) {
        if (size_ == room_) [[unlikely]]
            reserve(room_ + room_ / 2 + 16);
        data_[size_++] = value;
    }
    T pop() {
        T value = (*this)[size_ - 1];
        size_--;
        return value;
    }
    void clear() { size_ = 0; }

private:
    void release() {
        if (data_ != nullptr) {
            std::free(data_);
            budget_->give_back(room_ * sizeof(T));
        }
    }

    Budget* budget_ = nullptr;
    T* data_ = nullptr;
    size_t size_ = 0;
    size_t room_ = 0;
};

} // namespace meshtide
