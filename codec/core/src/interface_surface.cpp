// The C interface to what an encoder looks for in a mesh, to surfaces, and to the input's order.
#include "codec/preview_payload.hpp"
#include "interface.hpp"
#include "mesh/octree.hpp"
#include "surface/distance.hpp"
#include "surface/mirror.hpp"
#include "surface/order.hpp"
#include "surface/previews.hpp"
#include "surface/simplification.hpp"
#include "surface/triangles.hpp"

using namespace meshtide;

static_assert(sizeof(Vector) == 3 * sizeof(double));

struct mt_previews {
    mt_previews() : budget(UINT64_MAX) {}
    Budget budget;
    std::vector<Preview> made;
    std::vector<Array<uint8_t>> payloads;
    std::vector<mt_preview> list;
};

struct mt_tree {
    explicit mt_tree(const Surface& surface)
        : budget(UINT64_MAX), vertices(budget), faces(budget), points(
                                                                   [&] {
                                                                       vertices.copy(surface.vertices);
                                                                       faces.copy(surface.faces);
                                                                       if (surface.face_count() == 0)
                                                                           faces_or_vertices(surface, faces);
                                                                       return Surface{vertices.span(), faces.span()};
                                                                   }(),
                                                                   budget) {}
    Budget budget;
    Array<Vector> vertices;
    Array<int32_t> faces;
    ClosestPoints points;
};

struct mt_meter {
    mt_meter(const Surface& original, const DistanceOptions& options)
        : budget(UINT64_MAX), meter(original, options, budget) {}
    Budget budget;
    DistanceMeter meter;
};

struct mt_simplifier {
    mt_simplifier(const GridMesh& mesh, size_t finest)
        : budget(UINT64_MAX), simplifier(mesh.positions, mesh.faces, mesh.bits, finest, budget), reduced(budget) {}
    Budget budget;
    Simplifier simplifier;
    TriangleMesh reduced;
};

struct mt_order {
    explicit mt_order(uint64_t memory) : budget(memory), order(budget), payload(budget) {}
    Budget budget;
    InputOrder order;
    Array<uint8_t> payload;
};

namespace {

constexpr uint64_t MOST_VERTICES = 1u << 30, MOST_FACES = 1u << 29; // of surfaces: corners are counted in 32 bits

Span<const Vector> lent_vectors(const double* coordinates, uint64_t count) {
    require(count <= MOST_VERTICES, "too many points");
    for (double x : lent(coordinates, 3 * count)) require(std::isfinite(x), "coordinates must be finite");
    return lent(reinterpret_cast<const Vector*>(coordinates), count);
}

void check_corners(Span<const int32_t> corners, uint64_t vertex_count) {
    for (int32_t v : corners)
        require(v >= 0 && static_cast<uint64_t>(v) < vertex_count, "a face names a vertex that is not there");
}

Surface lent_surface(const mt_surface& surface) {
    require(surface.vertex_count > 0, "a surface needs at least one vertex");
    require(surface.face_count <= MOST_FACES, "too many faces");
    Surface lent_one{lent_vectors(surface.vertices, surface.vertex_count), lent(surface.faces, 3 * surface.face_count)};
    check_corners(lent_one.faces, surface.vertex_count);
    return lent_one;
}

void tell_points(const Surface& surface, Span<const Foot> feet, const mt_points& out) {
    for (size_t i = 0; i < feet.size(); i++) {
        Vector at = feet[i].on(surface);
        double coordinates[3] = {at.x, at.y, at.z};
        for (size_t k = 0; k < 3; k++) {
            out.points[3 * i + k] = coordinates[k];
            out.corners[3 * i + k] = surface.corner(static_cast<size_t>(feet[i].face), k);
            out.weights[3 * i + k] = feet[i].weight(k);
        }
    }
}

void check_bits(int bits) { require(bits >= 1 && bits <= MOST_BITS, "the depth of a grid is not 1..20"); }

GridMesh lent_grid_mesh(const mt_grid_mesh& mesh) {
    check_bits(mesh.bits);
    GridMesh lent_one{lent(mesh.positions, 3 * mesh.vertex_count), lent(mesh.faces, 3 * mesh.face_count), mesh.bits};
    check_grid_mesh(lent_one.positions, lent_one.faces, mesh.bits);
    return lent_one;
}

void make_payload(const Preview& preview, const Trained& trained, Array<uint8_t>& payload, Budget& budget) {
    constexpr uint64_t WHOLE[1] = {0};
    Octree octree(preview.positions.span(), preview.faces.span(), preview.bits, budget);
    auto layers = make_encoder_layers(Effort::standard, budget, octree, {}, {WHOLE, 1}, trained);
    encode_preview(octree, *layers, payload, budget);
}

// Hands out what `make` has made, with its payloads.
template <class Make>
int32_t hand_out_previews(const mt_states& states, mt_previews** previews, mt_error* error, Make make) {
    std::unique_ptr<mt_previews> all;
    int32_t fault = guarded(error, [&] {
        all = std::make_unique<mt_previews>();
        all->made = make(all->budget);
        for (const Preview& preview : all->made) {
            Array<uint8_t>& payload = all->payloads.emplace_back(all->budget);
            make_payload(preview, states.trained, payload, all->budget);
            all->list.push_back({{preview.positions.begin(), preview.vertex_count(), preview.faces.begin(),
                                  preview.faces.size() / 3, preview.bits},
                                 {payload.begin(), payload.size()}});
        }
    });
    *previews = fault == MT_OK ? all.release() : nullptr;
    return fault;
}

StreamMesh lent_stream_mesh(const mt_stream_mesh& mesh) {
    require(mesh.vertex_count <= INT32_MAX && mesh.face_count <= MOST_FACES, "too many vertices or faces");
    StreamMesh lent_one{lent(mesh.faces, 3 * mesh.face_count), static_cast<size_t>(mesh.vertex_count)};
    check_corners(lent_one.faces, mesh.vertex_count);
    return lent_one;
}

} // namespace

int32_t mt_find_mirror(const int32_t* positions, uint64_t vertex_count, int32_t bits, int32_t* axis, int32_t* sum,
                       mt_error* error) {
    return guarded(error, [&] {
        check_bits(bits);
        Span<const int32_t> all = lent(positions, 3 * vertex_count);
        check_positions(all, bits);
        Budget budget(UINT64_MAX);
        MirrorPlane found = find_mirror(all, budget);
        *axis = found.axis, *sum = found.sum;
    });
}

int32_t mt_previews_choose(const mt_grid_mesh* mesh, const mt_states* states, mt_previews** previews, mt_error* error) {
    return hand_out_previews(*states, previews, error, [&](Budget& budget) {
        Array<uint8_t> payload(budget);
        auto size = [&](const Preview& preview) {
            make_payload(preview, states->trained, payload, budget);
            return payload.size();
        };
        return choose_previews(lent_grid_mesh(*mesh), size, budget);
    });
}

int32_t mt_previews_make(const mt_grid_mesh* mesh, const uint64_t* ratios, uint64_t ratio_count,
                         const mt_states* states, mt_previews** previews, mt_error* error) {
    return hand_out_previews(*states, previews, error, [&](Budget& budget) {
        std::vector<size_t> wanted;
        for (uint64_t ratio : lent(ratios, ratio_count)) {
            require(ratio >= 2, "a preview must have fewer vertices than the mesh: a ratio is less than 2");
            wanted.push_back(checked_size(ratio));
        }
        return make_previews(lent_grid_mesh(*mesh), wanted, budget);
    });
}

void mt_previews_free(mt_previews* previews) { delete previews; }

uint64_t mt_previews_count(const mt_previews* previews) { return previews->list.size(); }

const mt_preview* mt_previews_list(const mt_previews* previews) { return previews->list.data(); }

int32_t mt_tree_new(const mt_surface* surface, mt_tree** tree, mt_error* error) {
    *tree = nullptr;
    return guarded(error, [&] { *tree = std::make_unique<mt_tree>(lent_surface(*surface)).release(); });
}

void mt_tree_free(mt_tree* tree) { delete tree; }

int32_t mt_tree_closest(const mt_tree* tree, const double* points, uint64_t count, const mt_points* closest,
                        mt_error* error) {
    return guarded(error, [&] {
        Budget budget(UINT64_MAX);
        Array<Foot> feet(budget);
        Span<const Vector> wanted = lent_vectors(points, count);
        feet.assign(wanted.size(), Foot());
        tree->points.closest(wanted, feet.span());
        tell_points(tree->points.surface(), feet.span(), *closest);
    });
}

int32_t mt_tree_sample(const mt_tree* tree, uint64_t seed, uint64_t count, const mt_points* samples, mt_error* error) {
    return guarded(error, [&] {
        Budget budget(UINT64_MAX);
        Array<Foot> feet(budget);
        feet.assign(checked_size(count), Foot());
        tree->points.sample(seed, feet.span(), budget);
        tell_points(tree->points.surface(), feet.span(), *samples);
    });
}

int32_t mt_meter_new(const mt_surface* original, uint64_t samples, uint64_t vertex_limit, uint64_t seed,
                     mt_meter** meter, mt_error* error) {
    *meter = nullptr;
    return guarded(error, [&] {
        DistanceOptions options{checked_size(samples), checked_size(vertex_limit), seed};
        *meter = std::make_unique<mt_meter>(lent_surface(*original), options).release();
    });
}

void mt_meter_free(mt_meter* meter) { delete meter; }

int32_t mt_meter_measure(const mt_meter* meter, const mt_surface* other, double* rms, double* maximum,
                         mt_error* error) {
    return guarded(error, [&] {
        Budget budget(UINT64_MAX);
        Distortion found = meter->meter.measure(lent_surface(*other), budget);
        *rms = found.rms, *maximum = found.maximum;
    });
}

int32_t mt_simplifier_new(const mt_grid_mesh* mesh, uint64_t finest, mt_simplifier** simplifier, mt_error* error) {
    *simplifier = nullptr;
    return guarded(error, [&] {
        GridMesh lent_one = lent_grid_mesh(*mesh);
        size_t most = std::min(checked_size(finest), lent_one.positions.size() / 3);
        *simplifier = std::make_unique<mt_simplifier>(lent_one, most).release();
    });
}

void mt_simplifier_free(mt_simplifier* simplifier) { delete simplifier; }

int32_t mt_simplifier_reduce(mt_simplifier* simplifier, uint64_t target, mt_surface* reduced, mt_error* error) {
    return guarded(error, [&] {
        const TriangleMesh& mesh = simplifier->reduced;
        simplifier->simplifier.reduce(checked_size(target), simplifier->reduced);
        *reduced = {reinterpret_cast<const double*>(mesh.vertices.begin()), mesh.vertices.size(), mesh.faces.begin(),
                    mesh.faces.size() / 3};
    });
}

int32_t mt_order_encode(const mt_input_order* input, const mt_stream_mesh* mesh, mt_order** order, mt_bytes* payload,
                        mt_error* error) {
    std::unique_ptr<mt_order> made;
    int32_t fault = guarded(error, [&] {
        require(input->vertex_count <= INT32_MAX && input->face_count <= MOST_FACES, "too many vertices or faces");
        made = std::make_unique<mt_order>(UINT64_MAX);
        made->order.vertices.copy(lent(input->vertices, input->vertex_count));
        made->order.faces.copy(lent(input->faces, 3 * input->face_count));
        encode_order(made->order, lent_stream_mesh(*mesh), made->payload, made->budget);
        *payload = {made->payload.begin(), made->payload.size()};
    });
    *order = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

int32_t mt_order_decode(const mt_bytes* payload, const mt_stream_mesh* mesh, const mt_limits* limits, uint64_t other_bytes,
                        mt_order** order, mt_input_order* input, mt_error* error) {
    constexpr PacketPlace PLACE{PacketKind::order, 0, 0};
    std::unique_ptr<mt_order> made;
    auto decode = [&] {
        made = std::make_unique<mt_order>(limits->memory);
        decode_order({lent(payload->data, payload->size), other_bytes}, lent_stream_mesh(*mesh),
                     *reinterpret_cast<const Limits*>(limits), made->order, made->budget);
        const Array<uint32_t>&vertices = made->order.vertices, &faces = made->order.faces;
        *input = {vertices.begin(), vertices.size(), faces.begin(), faces.size() / 3};
    };
    int32_t fault = guarded(error, decode, &PLACE);
    *order = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

void mt_order_free(mt_order* order) { delete order; }
