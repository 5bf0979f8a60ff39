#include "surface/rings.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

struct Wedge {
    int32_t from, to;
};

// The wedges of one vertex that are not in a chain yet, in their order but for those that have moved into gaps.
class Wedges {
public:
    Wedges(Wedge* first, Wedge* last) : first_(first), last_(last) {}

    bool empty() const { return first_ == last_; }
    Wedge take_first() { return *first_++; }
    // The first that begins, or ends, at a vertex; whether there is one.
    bool take_from(int32_t vertex, Wedge& taken) {
        return take([&](const Wedge& wedge) { return wedge.from == vertex; }, taken);
    }
    bool take_to(int32_t vertex, Wedge& taken) {
        return take([&](const Wedge& wedge) { return wedge.to == vertex; }, taken);
    }

private:
    template <class Condition>
    bool take(Condition condition, Wedge& taken) {
        Wedge* place = std::find_if(first_, last_, condition);
        if (place == last_) return false;
        taken = *place;
        *place = *first_++;
        return true;
    }

    Wedge *first_, *last_;
};

// Appends the ring; returns whether it is closed.
bool chain(Wedges wedges, Array<int32_t>& members) {
    bool closed = false;
    for (bool first_chain = true; !wedges.empty(); first_chain = false) {
        size_t begin = members.size();
        Wedge wedge = wedges.take_first();
        int32_t head = wedge.from, tail = wedge.to;
        members.push(head);
        while (tail != head) {
            members.push(tail);
            if (!wedges.take_from(tail, wedge)) break;
            tail = wedge.to;
        }
        if (tail == head) {
            closed = first_chain && wedges.empty();
            continue;
        }
        size_t forward = members.size();
        while (wedges.take_to(head, wedge)) {
            head = wedge.from;
            members.push(head);
        }
        // What was found backwards belongs in front, turned around.
        size_t backwards = members.size() - forward;
        std::reverse(members.begin() + begin, members.end());
        std::reverse(members.begin() + begin + backwards, members.end());
    }
    return closed;
}

} // namespace

void order_rings(Span<const int32_t> faces, size_t vertices, Rings& rings, Budget& budget) {
    Array<uint32_t> starts(budget);
    Array<Wedge> wedges(budget);
    starts.assign(vertices + 1, 0);
    for (int32_t v : faces) starts[static_cast<size_t>(v) + 1]++;
    add_up(starts.span());
    wedges.resize(faces.size());
    for (size_t t = 0; t + 2 < faces.size(); t += 3)
        for (size_t k = 0; k < 3; k++)
            wedges[starts[static_cast<size_t>(faces[t + k])]++] = {faces[t + (k + 1) % 3], faces[t + (k + 2) % 3]};

    rings.starts.assign(vertices + 1, 0);
    rings.closed.assign(vertices, 0);
    rings.members.clear();
    rings.members.reserve(faces.size());
    size_t begin = 0;
    for (size_t v = 0; v < vertices; v++) {
        size_t end = starts[v]; // each start has moved to its end
        Wedge* of_vertex = wedges.begin();
        if (end - begin > LONGEST_RING)
            for (size_t i = begin; i < end; i++) rings.members.push(wedges[i].from);
        else
            rings.closed[v] = chain({of_vertex + begin, of_vertex + end}, rings.members);
        rings.starts[v + 1] = static_cast<uint32_t>(rings.members.size());
        begin = end;
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
