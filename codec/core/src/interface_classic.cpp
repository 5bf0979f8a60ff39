// The C interface of profile classic: payloads, and the filters that predict its levels.
#include "classic/encoder.hpp"
#include "interface.hpp"
#include "surface/filters.hpp"

#include <algorithm>

using namespace meshtide;

struct mt_classic_encoder {
    explicit mt_classic_encoder(const Trained& trained)
        : budget(UINT64_MAX), payload(budget), encoder(budget, trained.of_classic()) {}
    Budget budget;
    Array<uint8_t> payload;
    ClassicEncoder encoder;
    bool has_base = false;

    mt_bytes lend() const { return {payload.begin(), payload.size()}; }
};

struct mt_graph {
    mt_graph() : budget(UINT64_MAX), graph(budget) {}
    mutable Budget budget;
    Graph graph;
};

namespace {

void check_canonical_faces(Span<const int32_t> faces, uint64_t vertices) {
    require(vertices > 0 && vertices < 1u << 28 && faces.size() / 3 < 1u << 28, "no vertices, or too many");
    for (size_t t = 0; t < faces.size(); t += 3) {
        int32_t a = faces[t], b = faces[t + 1], c = faces[t + 2];
        require(a >= 0 && a < b && a < c && b != c, "a face that is not canonical");
        require(static_cast<uint64_t>(std::max(b, c)) < vertices, "a corner that is no vertex");
        if (t == 0) continue;
        const int32_t* face = faces.block(t - 3, 6);
        require(std::lexicographical_compare(face, face + 3, face + 3, face + 6), "faces that do not ascend");
    }
}

Filter filter_of(const mt_filter& given) {
    require(given.kind >= 0 && given.kind <= 4, "a filter of no known kind");
    require(given.degree >= 0 && given.denominator_degree >= 0, "a filter of a degree below 0");
    Filter filter;
    filter.kind = static_cast<FilterKind>(given.kind);
    filter.basis = given.chebyshev != 0 ? FilterBasis::chebyshev : FilterBasis::power;
    filter.degree = static_cast<size_t>(given.degree);
    filter.denominator_degree = static_cast<size_t>(given.denominator_degree);
    filter.taubin_lambda = given.taubin_lambda;
    filter.taubin_mu = given.taubin_mu;
    return filter;
}

static_assert(sizeof(Vector) == 3 * sizeof(double));

Span<const Vector> lent_points(const double* values, size_t count) {
    return {reinterpret_cast<const Vector*>(values), count};
}
Span<Vector> lent_points(double* values, size_t count) { return {reinterpret_cast<Vector*>(values), count}; }

} // namespace

int32_t mt_classic_encoder_new(const mt_states* states, mt_classic_encoder** encoder, mt_error* error) {
    *encoder = nullptr;
    return guarded(error, [&] { *encoder = std::make_unique<mt_classic_encoder>(states->trained).release(); });
}

void mt_classic_encoder_free(mt_classic_encoder* encoder) { delete encoder; }

int32_t mt_classic_encoder_base(mt_classic_encoder* encoder, const int32_t* cells, uint64_t vertex_count, int32_t bits,
                                const int32_t* faces, uint64_t face_count, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(!encoder->has_base, "a second Base");
        require(bits >= 0 && bits <= MOST_BITS, "cells of more bits than B may have");
        check_grid_mesh(lent(cells, 3 * vertex_count), lent(faces, 3 * face_count), bits);
        check_canonical_faces(lent(faces, 3 * face_count), vertex_count);
        encoder->has_base = true;
        encoder->encoder.encode_base(lent(cells, 3 * vertex_count), bits, lent(faces, 3 * face_count),
                                     encoder->payload);
        *payload = encoder->lend();
    });
}

int32_t mt_classic_encoder_map_conn(mt_classic_encoder* encoder, const int32_t* parents, uint64_t vertex_count,
                                    const int32_t* faces, uint64_t face_count, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(encoder->has_base, "a Map&Conn before the Base");
        check_canonical_faces(lent(faces, 3 * face_count), vertex_count);
        Span<const int32_t> given = lent(parents, vertex_count);
        for (size_t v = 0; v < given.size(); v++) {
            int32_t before = v == 0 ? -1 : given[v - 1];
            require(given[v] == before + 1 || (v > 0 && given[v] == before), "parents that leave one out");
        }
        require(static_cast<size_t>(given[given.size() - 1]) + 1 == encoder->encoder.vertex_count(),
                "parents of another level");
        encoder->encoder.encode_map_conn(given, lent(faces, 3 * face_count), encoder->payload);
        *payload = encoder->lend();
    });
}

int32_t mt_classic_encoder_diff(mt_classic_encoder* encoder, const int32_t* differences, uint64_t vertex_count,
                                mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        Span<const int32_t> given = lent(differences, 3 * vertex_count);
        for (int32_t difference : given) require(difference != INT32_MIN, "a Diff of more than 31 bits");
        encoder->encoder.encode_diff(given, encoder->payload);
        *payload = encoder->lend();
    });
}

int32_t mt_classic_decode_diff(int32_t level, const uint8_t* payload, uint64_t size, uint64_t vertex_count,
                               int32_t* differences, mt_error* error) {
    PacketPlace place{PacketKind::diff, static_cast<uint32_t>(level), 0};
    return guarded(
        error,
        [&] {
            Budget budget(UINT64_MAX);
            RangeDecoder coder(lent(payload, size));
            code_differences(coder, {differences, checked_size(3 * vertex_count)}, budget);
            coder.finish();
        },
        &place);
}

int32_t mt_graph_new(const int32_t* faces, uint64_t face_count, uint64_t vertex_count, mt_graph** graph,
                     mt_error* error) {
    *graph = nullptr;
    return guarded(error, [&] {
        require(vertex_count <= INT32_MAX, "more vertices than indices can name");
        auto made = std::make_unique<mt_graph>();
        build_graph(lent(faces, 3 * face_count), checked_size(vertex_count), made->graph, made->budget);
        *graph = made.release();
    });
}

void mt_graph_free(mt_graph* graph) { delete graph; }

void mt_graph_get_lists(const mt_graph* graph, mt_graph_lists* lists) {
    const Graph& made = graph->graph;
    *lists = {made.offsets.begin(), made.neighbours.begin(), made.vertex_count(), made.neighbours.size()};
}

int32_t mt_graph_apply(const mt_graph* graph, const double* values, int32_t columns, double* products,
                       mt_error* error) {
    return guarded(error, [&] {
        size_t count = graph->graph.vertex_count();
        require(columns == 1 || columns == 3, "neither one nor three values for each vertex");
        if (columns == 1)
            apply_k(graph->graph, Span<const double>(values, count), Span<double>(products, count));
        else
            apply_k(graph->graph, lent_points(values, count), lent_points(products, count));
    });
}

int32_t mt_graph_predict(const mt_graph* graph, const mt_filter* filter, const float* coefficients,
                         const double* extension, double* prediction, mt_error* error) {
    return guarded(error, [&] {
        size_t count = graph->graph.vertex_count();
        Filter made = filter_of(*filter);
        predict(graph->graph, made, {coefficients, 3 * made.coefficient_count()}, lent_points(extension, count),
                lent_points(prediction, count), graph->budget);
    });
}

int32_t mt_graph_divide(const mt_graph* graph, const float* denominator, uint64_t degree, double* values,
                        mt_error* error) {
    return guarded(error, [&] {
        Span<const float> given = lent(denominator, degree);
        require(is_safe_denominator(given), "a denominator that is not safely positive");
        divide(graph->graph, given, {values, graph->graph.vertex_count()}, graph->budget);
    });
}

int32_t mt_is_safe_denominator(const float* denominator, uint64_t degree) {
    return is_safe_denominator({denominator, static_cast<size_t>(degree)});
}

double mt_dot(const double* first, const double* second, uint64_t count) {
    double lanes[4] = {};
    size_t n = static_cast<size_t>(count), whole = n - n % 4;
    for (size_t i = 0; i < whole; i += 4)
        for (size_t lane = 0; lane < 4; lane++) lanes[lane] += first[i + lane] * second[i + lane];
    for (size_t i = whole; i < n; i++) lanes[0] += first[i] * second[i];
    return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
}
