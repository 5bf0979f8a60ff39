// Plain bytes: numbers in base 128, coordinates, distances (docs/format.md, Header).
#pragma once

#include "base/memory.hpp"

namespace meshtide {

// Bytes that are read from front to end; every failure says where.
class ByteReader {
public:
    explicit ByteReader(Span<const uint8_t> bytes) : bytes_(bytes) {}

    size_t position() const { return position_; }
    bool at_end() const { return position_ == bytes_.size(); }
    uint8_t byte();
    // Base 128, lowest digits first, at most nine of them.
    uint64_t number();
    // 0, -1, 1, -2, ... for 0, 1, 2, 3, ...
    int64_t signed_number();
    // `count` bytes, the lowest first.
    uint64_t fixed(int count);
    double coordinate();
    // The rest of the bytes.
    Span<const uint8_t> rest() const { return bytes_.part(position_, bytes_.size() - position_); }

    [[noreturn]] void fail_here(const char* text) const;

private:
    Span<const uint8_t> bytes_;
    size_t position_ = 0;
};

void write_number(Array<uint8_t>& out, uint64_t value);
void write_signed(Array<uint8_t>& out, int64_t value);
void write_fixed(Array<uint8_t>& out, int count, uint64_t value);
// The shortest form that gives a finite number exactly: decimal, single, or double.
void write_coordinate(Array<uint8_t>& out, double value);

// How far a state is from the finest mesh, in fractions of its diagonal, as a header holds it: rounded up, two bytes.
struct Distances {
    double rms = 0;
    double maximum = 0;
};
uint16_t pack_distances(Distances distances);
Distances unpack_distances(uint16_t word);

} // namespace meshtide
