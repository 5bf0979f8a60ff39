// What only an encoder knows: the faces of the fine level, and which of them are coded already.
#pragma once

#include "mesh/level.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// Three corners for each face, the least one first, in lexicographic order, none twice.
struct FacesTruth {
    Span<const int32_t> faces;
};

// Corners of faces, each 3 face + k, in the order of keys that begin with a number, of which the first with a key is
// found that is not coded. What is coded is skipped, and the skips are remembered, so that very many faces with one key
// do not cost more and more.
class UntoldList {
public:
    explicit UntoldList(Budget& budget) : corners_(budget), places_(budget), later_(budget) {}

    void clear() { corners_.clear(); }
    void give_back() {
        corners_.give_back();
        places_.give_back();
        later_.give_back();
    }
    void push(int32_t corner) { corners_.push(corner); }
    // number(c): what the key of c begins with, below `numbers`; less(a, b): of keys that begin with the same one.
    template <class Number, class Less>
    void sort(size_t numbers, Number number, Less less, Budget& budget) {
        Array<int32_t> given(budget);
        given.copy(corners_.span());
        places_.assign(numbers + 1, 0);
        for (int32_t c : given) places_[number(c) + 1]++;
        for (size_t i = 0; i < numbers; i++) places_[i + 1] += places_[i];
        for (int32_t c : given) corners_[places_[number(c)]++] = c;
        for (size_t i = numbers; i > 0; i--) places_[i] = places_[i - 1];
        places_[0] = 0;
        for (size_t i = 0; i < numbers; i++)
            std::sort(corners_.begin() + places_[i], corners_.begin() + places_[i + 1], less);
    }
    // same(a, b): the keys are the same.
    template <class Same>
    bool repeats(Same same) const {
        return std::adjacent_find(corners_.begin(), corners_.end(), same) != corners_.end();
    }
    // Nothing is coded yet.
    void restart() {
        later_.resize(corners_.size() + 1);
        for (size_t i = 0; i < later_.size(); i++) later_[i] = static_cast<uint32_t>(i);
    }
    // before(c): the key of c, which begins with `number`, is less than what is sought; same(c): it is this; coded(c).
    template <class Before, class Same, class Coded>
    int32_t find(size_t number, Before before, Same same, Coded coded) {
        if (number + 1 >= places_.size()) return NONE;
        const int32_t* corners = corners_.begin();
        const int32_t* place = std::partition_point(corners + places_[number], corners + places_[number + 1], before);
        auto at = static_cast<size_t>(place - corners_.begin());
        while (true) {
            at = uncoded_from(at);
            if (at == corners_.size() || !same(corners_[at])) return NONE;
            if (!coded(corners_[at])) return corners_[at];
            later_[at] = static_cast<uint32_t>(at + 1);
        }
    }

private:
    size_t uncoded_from(size_t at) {
        size_t end = at;
        while (later_[end] != end) end = later_[end];
        while (at != end) {
            size_t next = later_[at];
            later_[at] = static_cast<uint32_t>(end);
            at = next;
        }
        return end;
    }
    Array<int32_t> corners_;
    Array<uint32_t> places_; // where the corners of each number begin
    Array<uint32_t> later_;  // of each place: the same, or a later one if what is there is coded
};

class TruthIndex {
public:
    explicit TruthIndex(Budget& budget) : budget_(budget), edges_(budget), images_(budget), coded_(budget) {}

    void index(FacesTruth truth, Span<const uint32_t> parents) {
        faces_ = truth.faces;
        parents_ = parents;
        edges_.clear();
        images_.clear();
        has_images_ = false;
        for (size_t i = 0; i < faces_.size(); i++) edges_.push(static_cast<int32_t>(i));
        auto less = [&](int32_t a, int32_t b) {
            int32_t x = vertex(a, 1), y = vertex(b, 1);
            return x != y ? x < y : a < b;
        };
        edges_.sort(
            parents.size(), [&](int32_t c) { return static_cast<size_t>(vertex(c, 0)); }, less, budget_);
        edges_repeat_ = edges_.repeats(
            [&](int32_t a, int32_t b) { return vertex(a, 1) == vertex(b, 1) && vertex(a, 0) == vertex(b, 0); });
    }
    // Does an edge have several faces a side?
    bool edges_repeat() const { return edges_repeat_; }
    // Gives back all that was taken.
    void rest() {
        edges_.give_back();
        images_.give_back();
        coded_.give_back();
    }
    // Nothing is coded yet.
    void restart() {
        coded_.assign(faces_.size() / 3, 0);
        first_uncoded_ = 0;
        edges_.restart();
        if (has_images_) images_.restart();
    }

    size_t face_count() const { return coded_.size(); }
    // The vertex so many corners after this one.
    int32_t vertex(int32_t corner, int32_t steps) const {
        return faces_[static_cast<size_t>(corner - corner % 3 + (corner + steps) % 3)];
    }
    void mark_coded(int32_t corner) { coded_[static_cast<size_t>(corner) / 3] = 1; }

    // Where a -> b begins, in the first such face that is not coded yet, or NONE.
    int32_t find(int32_t a, int32_t b) {
        return edges_.find(
            static_cast<size_t>(a), [&](int32_t c) { return vertex(c, 1) < b; },
            [&](int32_t c) { return vertex(c, 0) == a && vertex(c, 1) == b; }, [&](int32_t c) { return is_coded(c); });
    }
    // The first corner of the face with these ones, of which the first is the least, or NONE if there is none to code.
    int32_t find(int32_t a, int32_t b, int32_t c) const {
        size_t low = 0, high = face_count();
        int32_t wanted[3] = {a, b, c};
        while (low < high) {
            size_t middle = (low + high) / 2;
            const int32_t* face = faces_.block(3 * middle, 3);
            if (std::lexicographical_compare(face, face + 3, wanted, wanted + 3))
                low = middle + 1;
            else
                high = middle;
        }
        auto first = static_cast<int32_t>(3 * low);
        if (low == face_count() || !std::equal(wanted, wanted + 3, faces_.block(3 * low, 3)) || is_coded(first))
            return NONE;
        return first;
    }
    // The corner above p of the first face above the coarse face (p, q, r) that is not coded, or NONE.
    int32_t find_above(uint32_t p, uint32_t q, uint32_t r) {
        if (!has_images_) index_images();
        Image wanted{p, q, r};
        return images_.find(
            p, [&](int32_t c) { return image(c) < wanted; }, [&](int32_t c) { return image(c) == wanted; },
            [&](int32_t c) { return is_coded(c); });
    }
    // The first face that is not coded yet, as its first corner, or NONE.
    int32_t find_any() {
        while (first_uncoded_ < face_count() && coded_[first_uncoded_] != 0) first_uncoded_++;
        return first_uncoded_ < face_count() ? static_cast<int32_t>(3 * first_uncoded_) : NONE;
    }

private:
    struct Image {
        uint32_t p, q, r;
        bool operator==(const Image&) const = default;
        auto operator<=>(const Image&) const = default;
    };
    uint32_t parent(int32_t corner, int32_t steps) const {
        return parents_[static_cast<size_t>(vertex(corner, steps))];
    }
    Image image(int32_t corner) const { return {parent(corner, 0), parent(corner, 1), parent(corner, 2)}; }
    bool is_coded(int32_t corner) const { return coded_[static_cast<size_t>(corner) / 3] != 0; }
    void index_images() {
        has_images_ = true;
        for (size_t i = 0; i < faces_.size(); i++) {
            Image above = image(static_cast<int32_t>(i));
            if (above.p != above.q && above.q != above.r && above.r != above.p) images_.push(static_cast<int32_t>(i));
        }
        auto less = [&](int32_t a, int32_t b) {
            Image x = image(a), y = image(b);
            return x != y ? x < y : a < b;
        };
        images_.sort(
            static_cast<size_t>(*std::max_element(parents_.begin(), parents_.end())) + 1,
            [&](int32_t c) { return static_cast<size_t>(parent(c, 0)); }, less, budget_);
        images_.restart();
    }

    Budget& budget_;
    Span<const int32_t> faces_;
    Span<const uint32_t> parents_;
    UntoldList edges_, images_;
    Array<uint8_t> coded_;
    size_t first_uncoded_ = 0;
    bool has_images_ = false, edges_repeat_ = false;
};

} // namespace meshtide::inline MESHTIDE_ISA
