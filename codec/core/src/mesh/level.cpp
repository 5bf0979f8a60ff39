#include "mesh/level.hpp"

#include <algorithm>
#include <utility>

namespace meshtide::inline MESHTIDE_ISA {

void link(Level& level, Budget& budget) {
    size_t faces = level.face_count(), vertices = level.vertex_count();
    level.twins.assign(4 * faces, NONE);
    level.heads.assign(vertices, NONE);

    // The half-edges of each vertex, by counting.
    Array<uint32_t> starts(budget), leaving(budget);
    starts.assign(vertices + 1, 0);
    auto corner = [&](size_t h) { return static_cast<size_t>(level.corners[h]); };
    for (size_t t = 0; t < faces; t++)
        for (size_t k = 0; k < 3; k++) starts[corner(4 * t + k) + 1]++;
    add_up(starts.span());
    leaving.resize(3 * faces);
    for (size_t t = 0; t < faces; t++)
        for (size_t k = 0; k < 3; k++) leaving[starts[corner(4 * t + k)]++] = static_cast<uint32_t>(4 * t + k);
    for (size_t v = vertices; v > 0; v--) starts[v] = starts[v - 1];
    starts[0] = 0;

    // For each vertex, what leaves it, in a list for each vertex that it runs to; then what comes back, in order, takes
    // the first that is left. Each face has one half-edge that leaves a vertex, and one that reaches it.
    Array<int32_t> first(budget), later(budget);
    first.assign(vertices, NONE);
    later.assign(4 * faces, NONE);
    for (size_t v = 0; v < vertices; v++) {
        for (size_t i = starts[v + 1]; i-- > starts[v];) {
            auto h = static_cast<int32_t>(leaving[i]);
            int32_t& list = first[corner(static_cast<size_t>(next_half_edge(h)))];
            later[static_cast<size_t>(h)] = list;
            list = h;
        }
        for (size_t i = starts[v]; i < starts[v + 1]; i++) {
            int32_t back = previous_half_edge(static_cast<int32_t>(leaving[i]));
            size_t from = corner(static_cast<size_t>(back));
            int32_t h = first[from];
            if (from <= v || h == NONE) continue; // each pair once
            first[from] = later[static_cast<size_t>(h)];
            level.twins[static_cast<size_t>(h)] = back;
            level.twins[static_cast<size_t>(back)] = h;
        }
        for (size_t i = starts[v]; i < starts[v + 1]; i++)
            first[corner(static_cast<size_t>(next_half_edge(static_cast<int32_t>(leaving[i]))))] = NONE;
    }
    for (size_t t = faces; t-- > 0;) {
        for (size_t k = 3; k-- > 0;) {
            size_t h = 4 * t + k, v = corner(h);
            int32_t head = level.heads[v];
            if (head < 0 || level.twins[static_cast<size_t>(head)] >= 0 || level.twins[h] < 0)
                level.heads[v] = static_cast<int32_t>(h);
        }
    }
}

namespace {

// Of one vertex, mostly two or three; J. W. J. Williams, "Algorithm 232: Heapsort", 1964.
void sort(Span<uint64_t> words) {
    size_t count = words.size();
    if (count < 2) return;
    auto sink = [&](size_t place, size_t end) {
        for (size_t child; (child = 2 * place + 1) < end; place = child) {
            if (child + 1 < end && words[child + 1] > words[child]) child++;
            if (words[place] >= words[child]) return;
            std::swap(words[place], words[child]);
        }
    };
    for (size_t place = count / 2; place-- > 0;) sink(place, count);
    for (size_t end = count; --end > 0;) {
        std::swap(words[0], words[end]);
        sink(0, end);
    }
}

} // namespace

void canonical_faces(const Level& level, Array<int32_t>& faces, Budget& budget) {
    size_t count = level.face_count(), vertices = level.heads.size();
    Array<uint32_t> starts(budget); // by the least corner
    starts.assign(vertices + 1, 0);
    Span<const int32_t> corners = level.corners.span();
    // Without branches: which corner is the least is anybody's guess.
    auto least = [](const int32_t* face) { return std::min(std::min(face[0], face[1]), face[2]); };
    for (size_t t = 0; t < count; t++) starts[static_cast<size_t>(least(corners.block(4 * t, 3))) + 1]++;
    add_up(starts.span());
    Array<uint64_t> others(budget); // the two other corners
    others.resize(count);
    for (size_t t = 0; t < count; t++) {
        const int32_t* face = corners.block(4 * t, 3);
        int32_t a = least(face);
        bool first = face[0] == a, second = face[1] == a;
        int32_t b = first ? face[1] : second ? face[2] : face[0], c = first ? face[2] : second ? face[0] : face[1];
        others[starts[static_cast<size_t>(a)]++] = static_cast<uint64_t>(b) << 32 | static_cast<uint32_t>(c);
    }
    faces.resize(3 * count);
    size_t first = 0;
    for (size_t v = 0; v < vertices; v++) {
        size_t end = starts[v];
        sort(others.span().part(first, end - first));
        for (size_t i = first; i + 1 < end; i++) expect(others[i] != others[i + 1], "a face is there twice");
        for (; first < end; first++) {
            faces[3 * first] = static_cast<int32_t>(v);
            faces[3 * first + 1] = static_cast<int32_t>(others[first] >> 32);
            faces[3 * first + 2] = static_cast<int32_t>(others[first]);
        }
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
