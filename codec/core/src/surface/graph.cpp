#include "surface/graph.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

void build_graph(Span<const int32_t> faces, size_t vertices, Graph& graph, Budget& budget) {
    Array<uint32_t> starts(budget), ends(budget);
    Array<int32_t> sources(budget);
    starts.assign(vertices + 1, 0);
    auto each_edge = [&](auto visit) {
        for (size_t t = 0; t + 2 < faces.size(); t += 3)
            for (size_t k = 0; k < 3; k++) {
                int32_t a = faces[t + k], b = faces[t + (k == 2 ? 0 : k + 1)];
                if (a == b) continue;
                visit(a, b);
                visit(b, a);
            }
    };
    if (faces.size() > UINT32_MAX / 4) fail(Fault::argument, "more faces than a graph can have");
    for (int32_t v : faces)
        if (v < 0 || static_cast<size_t>(v) >= vertices)
            fail(Fault::argument, "a face names a vertex that is not there");
    // A counting sort; its lists, transposed, come out ascending, and are thinned on the way.
    each_edge([&](int32_t of, int32_t) { starts[static_cast<size_t>(of) + 1]++; });
    add_up(starts.span());
    ends.copy(starts.span());
    sources.resize(starts[vertices]);
    each_edge([&](int32_t of, int32_t source) { sources[ends[static_cast<size_t>(of)]++] = source; });
    ends.copy(starts.span());
    graph.neighbours.resize(sources.size());
    for (size_t v = 0; v < vertices; v++) {
        for (size_t i = starts[v]; i < starts[v + 1]; i++) {
            auto source = static_cast<size_t>(sources[i]);
            uint32_t& end = ends[source];
            if (end == starts[source] || graph.neighbours[end - 1] != static_cast<int32_t>(v))
                graph.neighbours[end++] = static_cast<int32_t>(v);
        }
    }
    graph.offsets.resize(vertices + 1);
    uint32_t total = 0;
    for (size_t v = 0; v < vertices; v++) {
        graph.offsets[v] = total;
        for (size_t i = starts[v]; i < ends[v]; i++) graph.neighbours[total++] = graph.neighbours[i];
    }
    graph.offsets[vertices] = total;
    graph.neighbours.resize(total);
}

void apply_k(const Graph& graph, Span<const double> values, Span<double> products) {
    for (size_t v = 0; v < values.size(); v++) {
        uint32_t first = graph.offsets[v], last = graph.offsets[v + 1];
        double total = 0.0;
        for (uint32_t i = first; i < last; i++) total += values[static_cast<size_t>(graph.neighbours[i])];
        products[v] = first == last ? 0.0 : values[v] - total / static_cast<double>(last - first);
    }
}

void apply_k(const Graph& graph, Span<const Vector> values, Span<Vector> products) {
    for (size_t v = 0; v < values.size(); v++) {
        uint32_t first = graph.offsets[v], last = graph.offsets[v + 1];
        Vector total;
        for (uint32_t i = first; i < last; i++) total = total + values[static_cast<size_t>(graph.neighbours[i])];
        auto count = static_cast<double>(last - first);
        products[v] = first == last ? Vector{} : values[v] - Vector{total.x / count, total.y / count, total.z / count};
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
