// The binary range coder (docs/format.md, Range coder): 32-bit range, carry propagation.
//
// G. N. N. Martin, "Range encoding", 1979, in the form that LZMA gave it. One class for both directions: whoever codes
// a decision hands it the bit, and gets the bit back; a decoder ignores what it is handed.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

#include <bit>

namespace meshtide::inline MESHTIDE_ISA {

// Probabilities are those of a one, out of 65536.
constexpr uint32_t LEAST_PROBABILITY = 48;
constexpr uint32_t GREATEST_PROBABILITY = 65488;

constexpr uint32_t WHOLE_RANGE = 0xffffffffu; // before anything is coded; never after

class RangeEncoder {
public:
    static constexpr bool encoding = true;

    explicit RangeEncoder(Array<uint8_t>& out) : out_(out) { out_.clear(); }

    MESHTIDE_INLINE int code(uint32_t probability, int bit) {
        uint32_t bound = (range_ >> 16) * probability;
        if (bit != 0) {
            range_ = bound;
        } else {
            low_ += bound;
            range_ -= bound;
        }
        while (range_ < (1u << 24)) {
            range_ <<= 8;
            shift();
        }
        return bit;
    }

    // Writes what is left, in as few bytes as a decoder needs that reads zeros behind the end.
    void finish() {
        uint64_t last = low_ + range_ - 1;
        for (int zeros = 32; zeros >= 0; zeros--) {
            uint64_t value = last >> zeros << zeros;
            if (value >= low_) {
                low_ = value;
                break;
            }
        }
        for (int i = 0; i < 5; i++) shift();
        while (!out_.empty() && out_.back() == 0) out_.pop();
    }

    // How many bytes are certain, for those who want to know what something took.
    size_t size() const { return out_.size() + static_cast<size_t>(waiting_); }

    // Whether anything was coded: what was may take no byte at all.
    bool has_coded() const { return range_ != WHOLE_RANGE; }

    // Where it is, so that it can return there and code something else.
    struct Mark {
        size_t written;
        uint64_t low, waiting;
        uint32_t range;
        uint8_t cache;
        bool first;
    };
    Mark mark() const { return {out_.size(), low_, waiting_, range_, cache_, first_}; }
    void return_to(const Mark& mark) {
        out_.resize(mark.written); // what is written stays as it is
        low_ = mark.low, waiting_ = mark.waiting, range_ = mark.range;
        cache_ = mark.cache, first_ = mark.first;
    }

private:
    void shift() {
        auto low = static_cast<uint32_t>(low_);
        auto carry = static_cast<uint8_t>(low_ >> 32);
        if (low < 0xff000000u || carry != 0) {
            if (!first_) out_.push(static_cast<uint8_t>(cache_ + carry)); // the very first byte is always 0
            first_ = false;
            for (; waiting_ > 0; waiting_--) out_.push(static_cast<uint8_t>(0xff + carry));
            cache_ = static_cast<uint8_t>(low >> 24);
        } else {
            waiting_++;
        }
        low_ = static_cast<uint64_t>(low) << 8 & 0xffffffffu;
    }

    Array<uint8_t>& out_;
    uint64_t low_ = 0;
    uint32_t range_ = WHOLE_RANGE;
    uint8_t cache_ = 0;
    bool first_ = true;
    uint64_t waiting_ = 0; // bytes of 0xff that a carry may still turn
};

class RangeDecoder {
public:
    static constexpr bool encoding = false;

    explicit RangeDecoder(Span<const uint8_t> payload)
        : begin_(payload.begin()), next_(payload.begin()), end_(payload.end()) {
        for (int i = 0; i < 4; i++) code_ = code_ << 8 | byte();
    }

    MESHTIDE_INLINE int code(uint32_t probability, int) {
        uint32_t bound = (range_ >> 16) * probability;
        int bit;
        if (code_ < bound) {
            range_ = bound;
            bit = 1;
        } else {
            code_ -= bound;
            range_ -= bound;
            bit = 0;
        }
        while (range_ < (1u << 24)) {
            range_ <<= 8;
            code_ = code_ << 8 | byte();
        }
        return bit;
    }

    // How many bytes were read, which is up to four more than what was decoded needs.
    size_t offset() const { return static_cast<size_t>(next_ - begin_); }

    // A payload must end where its decoder does.
    void finish() const { expect(next_ == end_, "bytes are left over at the end"); }

private:
    uint32_t byte() { return next_ < end_ ? *next_++ : 0; }

    const uint8_t* begin_;
    const uint8_t* next_;
    const uint8_t* end_;
    uint32_t range_ = WHOLE_RANGE;
    uint32_t code_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
