#include "diff/mirror.hpp"

#include "mesh/cell_table.hpp"

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr float REACH = 3.6f;  // half cells along the axis within which a leaf may be an image
constexpr float SLACK = 1.01f; // half cells within which an image agrees

} // namespace

void DiffMirror::find_partners(Budget& budget) {
    DiffSlice& s = slice_;
    size_t count = s.run_.count();
    // Of depth - 1; an owner's position is in its middle.
    float per_cell = 0.25f / half_;
    auto cell_of = [&](size_t row) { return reinterpret_cast<U32x4>(truncate(s.rows_[row].position * per_cell)); };
    CellTable table(budget);
    table.reset(count);
    for (size_t i = 0; i < count; i++) {
        if (s.leaf_depths_[i] == NO_LEAF) continue;
        U32x4 cell = cell_of(i);
        table.put(cell[0], cell[1], cell[2], static_cast<uint32_t>(i));
    }
    int axis = s.mirror_.axis, side = 1 << (depth_ - 1);
    for (size_t i = 0; i < count; i++) {
        if (s.leaf_depths_[i] >= depth_) continue;
        if (s.partners_[i] != NONE && s.likenesses_[i] != Likeness::differs) continue;
        s.partners_[i] = NONE;
        float image = s.mirror_.doubled() - s.rows_[i].position[axis], nearest = REACH * half_;
        U32x4 cell = cell_of(i);
        // Towards zero: above -1 in any case, since the plane is in the cube.
        int middle = static_cast<int>(image * per_cell + static_cast<float>(side)) - side;
        for (int k = middle - 1; k <= middle + 1; k++) {
            if (k < 0 || k >= side) continue;
            cell[axis] = static_cast<uint32_t>(k);
            int32_t found = table.find(cell[0], cell[1], cell[2]);
            if (found == NONE || static_cast<size_t>(found) == i) continue;
            float distance = s.rows_[static_cast<size_t>(found)].position[axis] - image;
            distance = distance < 0 ? -distance : distance;
            if (distance < nearest) {
                nearest = distance;
                s.partners_[i] = found;
            }
        }
    }
}

Reflection DiffMirror::look(size_t owner) const {
    const DiffSlice& s = slice_;
    Reflection reflection;
    int32_t partner = s.partners_[owner];
    if (partner == NONE) return reflection;
    int agreeing = 0, differing = 0;
    for (size_t k = s.ring_starts_[owner]; k < s.ring_starts_[owner + 1]; k++) {
        auto member = static_cast<size_t>(s.neighbours_[k].member);
        if (member >= s.likenesses_.size()) continue; // another slice's
        agreeing += s.likenesses_[member] == Likeness::agrees;
        differing += s.likenesses_[member] == Likeness::differs;
    }
    int verdict = agreeing + differing == 0 ? 3 : differing > agreeing ? 0 : differing > 0 ? 1 : 2;
    F32x4 image = s.rows_[static_cast<size_t>(partner)].position;
    image[s.mirror_.axis] = s.mirror_.doubled() - image[s.mirror_.axis];
    reflection.offset = (image - s.rows_[owner].position) * (1 / half_);
    reflection.state = 1 + verdict + (reflection.offset[3] > 0 ? 4 : 0);
    return reflection;
}

void DiffMirror::compare(size_t owner, const Reflection& reflection, F32x4 steps) {
    if (reflection.state < Reflection::KNOWN) return;
    DiffSlice& s = slice_;
    F32x4 missed = magnitude(reflection.offset - steps);
    bool agrees = missed[0] <= SLACK && missed[1] <= SLACK && missed[2] <= SLACK;
    Likeness likeness = agrees ? Likeness::agrees : Likeness::differs;
    s.likenesses_[owner] = likeness;
    Likeness& other = s.likenesses_[static_cast<size_t>(s.partners_[owner])];
    if (other == Likeness::undecided) other = likeness;
}

} // namespace meshtide::inline MESHTIDE_ISA
