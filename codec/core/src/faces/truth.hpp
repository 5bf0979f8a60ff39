// What only an encoder knows: the faces of the fine level, and which of them are told already.
#pragma once

#include "mesh/level.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// Three corners for each face, the least one first, in lexicographic order, none twice.
struct FacesTruth {
    Span<const int32_t> faces;
};

// Corners of faces, each 3 face + k, in some order, of which the first with a key is found that is not told. What is
// told is skipped, and the skips are remembered, so that very many faces with one key do not cost more and more.
class UntoldList {
public:
    explicit UntoldList(Budget& budget) : corners_(budget), later_(budget) {}

    void clear() { corners_.clear(); }
    void push(int32_t corner) { corners_.push(corner); }
    template <class Less>
    void sort(Less less) {
        std::sort(corners_.begin(), corners_.end(), less);
        later_.resize(corners_.size() + 1);
        for (size_t i = 0; i < later_.size(); i++) later_[i] = static_cast<uint32_t>(i);
    }
    // before(c): the key of c is less than what is sought; same(c): it is this; told(c).
    template <class Before, class Same, class Told>
    int32_t find(Before before, Same same, Told told) {
        const int32_t* place = std::partition_point(corners_.begin(), corners_.end(), before);
        auto at = static_cast<size_t>(place - corners_.begin());
        while (true) {
            at = untold_from(at);
            if (at == corners_.size() || !same(corners_[at])) return NONE;
            if (!told(corners_[at])) return corners_[at];
            later_[at] = static_cast<uint32_t>(at + 1);
        }
    }

private:
    size_t untold_from(size_t at) {
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
    Array<uint32_t> later_; // of each place: the same, or a later one if what is there is told
};

class TruthIndex {
public:
    explicit TruthIndex(Budget& budget) : edges_(budget), images_(budget), told_(budget) {}

    void start(FacesTruth truth, Span<const uint32_t> parents) {
        faces_ = truth.faces;
        parents_ = parents;
        told_.assign(faces_.size() / 3, 0);
        first_untold_ = 0;
        edges_.clear();
        images_.clear();
        has_images_ = false;
        for (size_t i = 0; i < faces_.size(); i++) edges_.push(static_cast<int32_t>(i));
        edges_.sort([&](int32_t a, int32_t b) {
            Edge x = edge(a), y = edge(b);
            return x.from != y.from ? x.from < y.from : x.to != y.to ? x.to < y.to : a < b;
        });
    }

    size_t face_count() const { return told_.size(); }
    // The vertex so many corners after this one.
    int32_t vertex(int32_t corner, int32_t steps) const {
        return faces_[static_cast<size_t>(corner - corner % 3 + (corner + steps) % 3)];
    }
    void tell(int32_t corner) { told_[static_cast<size_t>(corner) / 3] = 1; }

    // Where a -> b begins, in the first such face that is not told yet, or NONE.
    int32_t find(int32_t a, int32_t b) {
        return edges_.find(
            [&](int32_t c) {
                Edge x = edge(c);
                return x.from != a ? x.from < a : x.to < b;
            },
            [&](int32_t c) { return edge(c).from == a && edge(c).to == b; }, [&](int32_t c) { return is_told(c); });
    }
    // The first corner of the face with these ones, of which the first is the least, or NONE if there is none to tell.
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
        if (low == face_count() || !std::equal(wanted, wanted + 3, faces_.block(3 * low, 3)) || is_told(first))
            return NONE;
        return first;
    }
    // The corner above p of the first face above the coarse face (p, q, r) that is not told, or NONE.
    int32_t find_above(uint32_t p, uint32_t q, uint32_t r) {
        if (!has_images_) index_images();
        Image wanted{p, q, r};
        return images_.find([&](int32_t c) { return image(c) < wanted; }, [&](int32_t c) { return image(c) == wanted; },
                            [&](int32_t c) { return is_told(c); });
    }
    // The first face that is not told yet, as its first corner, or NONE.
    int32_t find_any() {
        while (first_untold_ < face_count() && told_[first_untold_] != 0) first_untold_++;
        return first_untold_ < face_count() ? static_cast<int32_t>(3 * first_untold_) : NONE;
    }

private:
    struct Edge {
        int32_t from, to;
    };
    struct Image {
        uint32_t p, q, r;
        bool operator==(const Image&) const = default;
        auto operator<=>(const Image&) const = default;
    };
    Edge edge(int32_t corner) const { return {vertex(corner, 0), vertex(corner, 1)}; }
    uint32_t parent(int32_t corner, int32_t steps) const {
        return parents_[static_cast<size_t>(vertex(corner, steps))];
    }
    Image image(int32_t corner) const { return {parent(corner, 0), parent(corner, 1), parent(corner, 2)}; }
    bool is_told(int32_t corner) const { return told_[static_cast<size_t>(corner) / 3] != 0; }
    void index_images() {
        has_images_ = true;
        for (size_t i = 0; i < faces_.size(); i++) {
            Image above = image(static_cast<int32_t>(i));
            if (above.p != above.q && above.q != above.r && above.r != above.p) images_.push(static_cast<int32_t>(i));
        }
        images_.sort([&](int32_t a, int32_t b) {
            Image x = image(a), y = image(b);
            return x != y ? x < y : a < b;
        });
    }

    Span<const int32_t> faces_;
    Span<const uint32_t> parents_;
    UntoldList edges_, images_;
    Array<uint8_t> told_;
    size_t first_untold_ = 0;
    bool has_images_ = false;
};

} // namespace meshtide::inline MESHTIDE_ISA
