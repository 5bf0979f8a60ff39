// Memory that is asked for before it is taken, and read only where it is.
//
// A Budget knows how many bytes its owner may hold; an Array takes its bytes from one and gives them back; a Span looks
// at the elements of an array. Every access is checked, in release builds too: what a stream says about places in
// memory can be wrong in ways that no other check foresees, and then it ends in a Failure.
#pragma once

#include "base/failure.hpp"
#include "base/inlining.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <utility>

namespace meshtide {

// A count that a stream or a caller gives, as one of elements in memory.
inline size_t checked_size(uint64_t count) {
    if (count > SIZE_MAX) [[unlikely]]
        fail(Fault::limit, "more elements than memory can have");
    return static_cast<size_t>(count);
}

// Moves the bytes of an array to where there are so many, none if that is 0; null if the system has none left, and then
// nothing has changed. Many bytes are mapped: then growing moves pages, and what is given back is the system's again.
void* moved_bytes(void* bytes, size_t before, size_t after);
// Gives back to the system what was freed in the whole process, where that takes a word.
void trim_heap();

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

    MESHTIDE_INLINE T& operator[](size_t index) const {
        if (index >= size_) [[unlikely]]
            fail_access();
        return data_[index];
    }
    // `count` elements from `first` on, for code that goes over them in vectors.
    T* block(size_t first, size_t count) const {
        if (first > size_ || count > size_ - first) [[unlikely]]
            fail_access();
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

// From how many there are of each kind, behind a free place, to where each kind begins.
void add_up(Span<uint32_t> counts);

// Bytes of its own, which can be moved: what arrays of all types have in common.
class ArrayBytes {
public:
    ArrayBytes(const ArrayBytes&) = delete;
    ArrayBytes& operator=(const ArrayBytes&) = delete;
    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    void clear() { size_ = 0; }
    // Empties the array, and gives back what it has taken.
    void give_back();
    Budget& budget() const { return *budget_; }

protected:
    explicit ArrayBytes(Budget& budget);
    ArrayBytes(ArrayBytes&& other) noexcept { swap(other); }
    ~ArrayBytes();
    void swap(ArrayBytes& other) noexcept;
    // Room for so many elements of so many bytes; what is there stays. Where nothing is, nothing is copied.
    void enlarge(size_t room, size_t bytes);
    // So many elements of so many bytes; new ones hold anything,
    void resize(size_t size, size_t bytes);
    void renew(size_t size, size_t bytes) {
        size_ = 0;
        resize(size, bytes);
    }
    // or all of them from the old size on are copies of this one.
    void fill(size_t size, const void* value, size_t bytes);
    void copy(const void* data, size_t size, size_t bytes);
    // Room for one more at least, by half of what there is.
    void grow(size_t bytes) { enlarge(room_ + room_ / 2 + 16, bytes); }

    Budget* budget_ = nullptr;
    void* data_ = nullptr;
    size_t size_ = 0;
    size_t room_ = 0;

private:
    uint64_t room_bytes_ = 0;
};

// Elements of its own, which can be copied as bytes. It grows by half of itself when it is pushed to, and keeps what it
// has taken when it shrinks: the arrays of one level serve the next.
template <class T>
class Array : public ArrayBytes {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    explicit Array(Budget& budget) : ArrayBytes(budget) {}
    Array(Array&& other) noexcept = default;
    Array& operator=(Array&& other) noexcept {
        swap(other);
        return *this;
    }
    void swap(Array& other) noexcept { ArrayBytes::swap(other); }

    MESHTIDE_INLINE T& operator[](size_t index) {
        if (index >= size_) [[unlikely]]
            fail_access();
        return begin()[index];
    }
    MESHTIDE_INLINE const T& operator[](size_t index) const {
        if (index >= size_) [[unlikely]]
            fail_access();
        return begin()[index];
    }

    Span<T> span() { return {begin(), size_}; }
    Span<const T> span() const { return {begin(), size_}; }
    T* begin() { return static_cast<T*>(data_); }
    T* end() { return begin() + size_; }
    const T* begin() const { return static_cast<const T*>(data_); }
    const T* end() const { return begin() + size_; }
    T& back() { return (*this)[size_ - 1]; }
    const T& back() const { return (*this)[size_ - 1]; }

    // Room for so many elements; what is there stays.
    void reserve(size_t room) {
        if (room > room_) enlarge(room, sizeof(T));
    }
    // So many elements; new ones hold anything.
    void resize(size_t size) { ArrayBytes::resize(size, sizeof(T)); }
    // The same, but what is there is not needed any more.
    void renew(size_t size) { ArrayBytes::renew(size, sizeof(T)); }
    void resize(size_t size, const T& value) { fill(size, &value, sizeof(T)); }
    // So many elements, all of this value.
    void assign(size_t size, const T& value) {
        size_ = 0;
        fill(size, &value, sizeof(T));
    }
    void copy(Span<const T> other) { ArrayBytes::copy(other.begin(), other.size(), sizeof(T)); }
    void push(const T& value) {
        if (size_ == room_) [[unlikely]]
            grow(sizeof(T));
        begin()[size_++] = value;
    }
    // `count` more elements, which hold anything; the first of them.
    T* extend(size_t count) {
        size_t old = size_;
        if (count > room_ - size_) [[unlikely]]
            reserve(room_ + (room_ / 2 < count ? count : room_ / 2));
        size_ += count;
        return begin() + old;
    }
    T pop() {
        T value = (*this)[size_ - 1];
        size_--;
        return value;
    }
};

// Objects of its own, which stay where they are.
template <class T>
class List {
public:
    explicit List(Budget& budget) : items_(budget) {}
    List(List&&) noexcept = default;
    List(const List&) = delete;
    List& operator=(const List&) = delete;
    ~List() { clear(); }

    template <class... Arguments>
    T& add(Arguments&&... arguments) {
        items_.push(nullptr); // before there is an object that could be lost
        T* made = new T(std::forward<Arguments>(arguments)...);
        items_.back() = made;
        return *made;
    }
    T& operator[](size_t index) { return *static_cast<T*>(items_[index]); }
    const T& operator[](size_t index) const { return *static_cast<const T*>(items_[index]); }
    size_t size() const { return items_.size(); }
    bool empty() const { return items_.empty(); }
    void remove(size_t index) {
        delete &(*this)[index];
        for (size_t i = index + 1; i < items_.size(); i++) items_[i - 1] = items_[i];
        items_.pop();
    }
    void clear() {
        while (!items_.empty()) delete static_cast<T*>(items_.pop());
    }

    class Iterator {
    public:
        explicit Iterator(void* const* place) : place_(place) {}
        T& operator*() const { return *static_cast<T*>(*place_); }
        Iterator& operator++() {
            place_++;
            return *this;
        }
        bool operator!=(const Iterator& other) const { return place_ != other.place_; }

    private:
        void* const* place_;
    };
    Iterator begin() const { return Iterator(items_.begin()); }
    Iterator end() const { return Iterator(items_.end()); }

private:
    Array<void*> items_;
};

} // namespace meshtide
