#include "surface/triangles.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// Sorts items into the order of `vertex(item)`, below `vertices`, and those of the same vertex by `less`.
template <class Item, class Vertex, class Less>
void sort_by_vertex(Array<Item>& items, size_t vertices, Vertex vertex, Less less, Budget& budget) {
    Array<uint32_t> starts(budget);
    Array<Item> sorted(budget);
    starts.assign(vertices + 1, 0);
    sorted.resize(items.size());
    for (const Item& item : items) starts[vertex(item) + 1]++;
    for (size_t v = 0; v < vertices; v++) starts[v + 1] += starts[v];
    for (const Item& item : items) sorted[starts[vertex(item)]++] = item;
    items.swap(sorted);
    for (size_t v = 0, first = 0; v < vertices; first = starts[v], v++) // each start has moved to its end
        if (starts[v] - first > 1) std::sort(items.begin() + first, items.begin() + starts[v], less);
}

struct Triangle {
    int32_t a, b, c;
    bool operator==(const Triangle&) const = default;
};

} // namespace

Span<const int32_t> faces_or_vertices(const Surface& surface, Array<int32_t>& points) {
    if (surface.face_count() != 0) return surface.faces;
    points.resize(3 * surface.vertices.size());
    for (size_t i = 0; i < points.size(); i++) points[i] = static_cast<int32_t>(i / 3);
    return points.span();
}

void canonical_faces(Array<int32_t>& faces, size_t vertices, Budget& budget) {
    Array<Triangle> triangles(budget);
    triangles.reserve(faces.size() / 3);
    for (size_t t = 0; t + 2 < faces.size(); t += 3) {
        int32_t a = faces[t], b = faces[t + 1], c = faces[t + 2];
        if (a == b || b == c || c == a) continue;
        if (b < a && b < c)
            triangles.push({b, c, a});
        else if (c < a && c < b)
            triangles.push({c, a, b});
        else
            triangles.push({a, b, c});
    }
    sort_by_vertex(
        triangles, vertices, [](const Triangle& t) { return static_cast<size_t>(t.a); },
        [](const Triangle& t, const Triangle& u) { return t.b != u.b ? t.b < u.b : t.c < u.c; }, budget);
    faces.clear();
    for (size_t t = 0; t < triangles.size(); t++) {
        if (t > 0 && triangles[t] == triangles[t - 1]) continue;
        faces.push(triangles[t].a);
        faces.push(triangles[t].b);
        faces.push(triangles[t].c);
    }
}

void find_edges(Span<const int32_t> faces, size_t vertices, Array<Edge>& edges, Budget& budget) {
    auto from = [&](uint32_t h) { return faces[h]; };
    auto to = [&](uint32_t h) { return faces[h % 3 == 2 ? h - 2 : h + 1]; };
    auto lower = [&](uint32_t h) { return std::min(from(h), to(h)); };
    auto upper = [&](uint32_t h) { return std::max(from(h), to(h)); };
    Array<uint32_t> corners(budget); // where edges begin, by their lower ends
    corners.resize(faces.size());
    for (uint32_t h = 0; h < corners.size(); h++) corners[h] = h;
    sort_by_vertex(
        corners, vertices, [&](uint32_t h) { return static_cast<size_t>(lower(h)); },
        [&](uint32_t g, uint32_t h) { return upper(g) != upper(h) ? upper(g) < upper(h) : g < h; }, budget);
    edges.clear();
    for (uint32_t h : corners) {
        if (!edges.empty() && edges.back().from == lower(h) && edges.back().to == upper(h))
            edges.back().faces++;
        else
            edges.push({lower(h), upper(h), h, 1});
    }
}

void drop_unused(Array<int32_t>& faces, size_t vertices, Array<int32_t>& used, Budget& budget) {
    Array<int32_t> numbers(budget);
    numbers.assign(vertices, 0);
    for (int32_t v : faces) numbers[static_cast<size_t>(v)] = 1;
    used.clear();
    for (size_t v = 0; v < vertices; v++) {
        if (numbers[v] == 0) continue;
        numbers[v] = static_cast<int32_t>(used.size());
        used.push(static_cast<int32_t>(v));
    }
    for (int32_t& v : faces) v = numbers[static_cast<size_t>(v)];
}

} // namespace meshtide::inline MESHTIDE_ISA
