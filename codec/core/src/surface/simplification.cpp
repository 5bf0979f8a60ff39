#include "surface/simplification.hpp"

#include "surface/sorting.hpp"

#include <algorithm>
#include <bit>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr size_t CLUSTERS_PER_VERTEX = 7; // before the first collapse, for each vertex of the finest simplified mesh
constexpr size_t FEWEST_CLUSTERS = 3000;  // it is quick from there, and details of small meshes are not lost
constexpr size_t HEAP_PER_EDGE = 2;       // entries, outdated ones included: current ones never exceed the edges

constexpr double BORDER_WEIGHT = 0.5;  // of a plane across a border edge, times the edge's squared length
constexpr double SETTLING_PULL = 1e-2; // weight of the squared distance to a cluster's middle, against that of planes
constexpr double LEAST_PULL = 1e-30;   // for vertices whose faces have no area
constexpr double PULL = 1e-3;          // weight of the squared distances to the collapsed ends
constexpr double TURNED = 0.2;         // cosine between a face's normals below which it counts as turned over
constexpr size_t WORK_PER_FACE = 500;  // surfaces take about 60, hubs with thousands of faces any number

constexpr int32_t NOTHING = -1;
constexpr uint32_t GONE = UINT32_MAX;

// The planes of the faces, and those across the border edges.
template <class QuadricOf>
void add_planes(const Surface& surface, QuadricOf quadric_of, Budget& budget) {
    for (size_t f = 0; f < surface.face_count(); f++) {
        Vector normal = surface.normal(f);
        double doubled = length(normal);
        if (!(doubled > 0.0)) continue;
        Quadric plane;
        plane.add_plane(surface.at(f, 0), normal * (1.0 / doubled), doubled / 6.0);
        for (size_t k = 0; k < 3; k++) quadric_of(surface.corner(f, k)).add(plane);
    }
    Array<Edge> edges(budget);
    find_edges(surface.faces, surface.vertices.size(), edges, budget);
    for (const Edge& edge : edges) {
        if (edge.faces != 1) continue;
        size_t face = edge.corner / 3, k = edge.corner % 3, next = k == 2 ? 0 : k + 1;
        Vector along = surface.at(face, next) - surface.at(face, k), normal = cross(along, surface.normal(face));
        double size = length(normal);
        if (!(size > 0.0)) continue;
        Quadric plane;
        plane.add_plane(surface.at(face, k), normal * (1.0 / size), BORDER_WEIGHT * dot(along, along));
        quadric_of(edge.from).add(plane);
        quadric_of(edge.to).add(plane);
    }
}

} // namespace

Simplifier::Simplifier(Span<const int32_t> positions, Span<const int32_t> faces, int bits, size_t finest,
                       Budget& budget)
    : budget_(budget), vertices_(budget), faces_(budget), alive_(budget), first_(budget), last_(budget),
      following_(budget), versions_(budget), marks_(budget), heap_(budget) {
    cluster(positions, faces, bits, std::max(FEWEST_CLUSTERS, CLUSTERS_PER_VERTEX * finest));
    list_corners();
    Array<Edge> edges(budget);
    find_edges(faces_.span(), vertices_.size(), edges, budget);
    heap_room_ = HEAP_PER_EDGE * edges.size() + 1;
    heap_.reserve(heap_room_);
    for (const Edge& edge : edges) heap_.push(entry_of(edge.from, edge.to));
    for (size_t i = heap_.size() / 4 + 1; i-- > 0;) sink(i);
}

// One vertex for each cell of the smallest depth that has enough of them, or for each of the mesh.
void Simplifier::cluster(Span<const int32_t> positions, Span<const int32_t> faces, int bits, size_t fewest) {
    size_t n = positions.size() / 3;
    // The depth at which each vertex is parted from the one before; how many part at each.
    Array<uint8_t> parted(budget_);
    parted.resize(n);
    size_t cells[33] = {};
    for (size_t i = 0; i < n; i++) {
        uint32_t differing = 0;
        for (size_t k = 0; k < 3; k++)
            differing |= static_cast<uint32_t>(i > 0 ? positions[3 * i + k] ^ positions[3 * i - 3 + k] : 0);
        int depth = i > 0 ? bits - (32 - std::countl_zero(differing)) + 1 : 0;
        if (depth < 0 || depth > bits) fail(Fault::argument, "positions must be different points of the grid");
        parted[i] = static_cast<uint8_t>(depth);
        cells[depth]++;
    }
    int depth = 0;
    for (size_t count = cells[0]; depth < bits && count < fewest;) count += cells[++depth];

    Array<int32_t> owners(budget_);
    Array<Vector> points(budget_);
    Array<uint32_t> sizes(budget_);
    owners.resize(n);
    points.resize(n);
    for (size_t i = 0; i < n; i++) {
        points[i] = {static_cast<double>(positions[3 * i]), static_cast<double>(positions[3 * i + 1]),
                     static_cast<double>(positions[3 * i + 2])};
        if (parted[i] <= depth) {
            vertices_.push({});
            sizes.push(0);
        }
        owners[i] = static_cast<int32_t>(vertices_.size() - 1);
        vertices_.back().position = vertices_.back().position + points[i];
        sizes.back()++;
    }
    auto owner = [&](int32_t v) { return owners[static_cast<size_t>(v)]; };
    add_planes(
        {points.span(), faces}, [&](int32_t v) -> Quadric& { return at(owner(v)).quadric; }, budget_);
    for (size_t v = 0; v < vertices_.size(); v++) {
        Vertex& vertex = vertices_[v];
        vertex.position = vertex.position * (1.0 / sizes[v]);
        if (sizes[v] > 1) { // settles where its planes want it
            double pull = SETTLING_PULL * vertex.quadric.trace() + LEAST_PULL;
            vertex.position = minimum(vertex.quadric, vertex.position, pull).place;
        }
    }
    faces_.reserve(faces.size());
    for (int32_t v : faces) faces_.push(owner(v));
    canonical_faces(faces_, vertices_.size(), budget_);
}

void Simplifier::list_corners() {
    size_t n = vertices_.size();
    alive_.assign(faces_.size() / 3, 1);
    first_.assign(n, NOTHING);
    last_.assign(n, NOTHING);
    following_.assign(faces_.size(), NOTHING);
    versions_.assign(n, GONE);
    marks_.assign(n, 0);
    for (size_t h = 0; h < faces_.size(); h++) {
        auto v = static_cast<size_t>(faces_[h]);
        if (first_[v] == NOTHING) {
            first_[v] = static_cast<int32_t>(h);
            versions_[v] = 0;
            live_++;
        } else {
            following_[static_cast<size_t>(last_[v])] = static_cast<int32_t>(h);
        }
        last_[v] = static_cast<int32_t>(h);
    }
}

void Simplifier::reduce(size_t target, TriangleMesh& reduced) {
    size_t limit = WORK_PER_FACE * (alive_.size() + 1);
    while (live_ > target && work_ < limit) {
        if (heap_.empty()) {
            if (gluing_) break;
            gluing_ = true;
            for (size_t v = 0; v < vertices_.size(); v++)
                queue_around(static_cast<int32_t>(v), static_cast<int32_t>(v));
            continue;
        }
        Entry entry = pop();
        if (!current(entry)) continue;
        int32_t u = entry.u(), v = entry.v;
        Vector to = collapsed(u, v).place;
        if ((!gluing_ && glues(u, v)) || turns(u, v, to) || turns(v, u, to)) continue;
        merge(u, v, to);
        queue_around(u, NOTHING);
    }
    reduced.faces.clear();
    for (size_t f = 0; f < alive_.size(); f++) {
        if (alive_[f] == 0) continue;
        for (size_t k = 0; k < 3; k++) reduced.faces.push(corner(f, k));
    }
    Array<int32_t> used(budget_);
    drop_unused(reduced.faces, vertices_.size(), used, budget_);
    reduced.vertices.clear();
    for (int32_t v : used) reduced.vertices.push(at(v).position);
    canonical_faces(reduced.faces, used.size(), budget_);
}

// What it costs to collapse an edge, and where the merged vertex goes: there is a pull to both ends.
QuadricMinimum Simplifier::collapsed(int32_t u, int32_t v) const {
    Vector middle = at(u).position * 0.5 + at(v).position * 0.5, half = at(u).position - middle;
    Quadric sum = at(u).quadric;
    sum.add(at(v).quadric);
    double pull = PULL * sum.trace() + LEAST_PULL;
    QuadricMinimum best = minimum(sum, middle, pull);
    best.value += pull * dot(half, half);
    return best;
}

Simplifier::Entry Simplifier::entry_of(int32_t u, int32_t v) const {
    auto cost = std::bit_cast<uint32_t>(static_cast<float>(collapsed(u, v).value));
    return {static_cast<uint64_t>(cost) << 32 | static_cast<uint32_t>(u), v,
            versions_[static_cast<size_t>(u)] + versions_[static_cast<size_t>(v)]};
}

// Whether the ends share more neighbours than faces: the collapse would glue other edges together.
bool Simplifier::glues(int32_t u, int32_t v) {
    mark_++;
    size_t shared_faces = 0, shared_vertices = 0;
    for (int32_t h = first_[static_cast<size_t>(u)]; h != NOTHING; h = following_[static_cast<size_t>(h)]) {
        work_++;
        auto face = static_cast<size_t>(h / 3);
        if (alive_[face] == 0) continue;
        for (size_t k = 0; k < 3; k++) {
            marks_[static_cast<size_t>(corner(face, k))] = mark_;
            shared_faces += corner(face, k) == v;
        }
    }
    marks_[static_cast<size_t>(u)] = marks_[static_cast<size_t>(v)] = 0;
    for (int32_t h = first_[static_cast<size_t>(v)]; h != NOTHING; h = following_[static_cast<size_t>(h)]) {
        work_++;
        auto face = static_cast<size_t>(h / 3);
        if (alive_[face] == 0) continue;
        for (size_t k = 0; k < 3; k++) {
            uint32_t& mark = marks_[static_cast<size_t>(corner(face, k))];
            shared_vertices += mark == mark_;
            if (mark == mark_) mark = 0;
        }
    }
    return shared_vertices > shared_faces;
}

// Whether a face of `moved` that survives its merging with `merged` would be turned over.
bool Simplifier::turns(int32_t moved, int32_t merged, Vector to) {
    Vector from = at(moved).position;
    for (int32_t h = first_[static_cast<size_t>(moved)]; h != NOTHING; h = following_[static_cast<size_t>(h)]) {
        work_++;
        auto face = static_cast<size_t>(h / 3), k = static_cast<size_t>(h % 3);
        if (alive_[face] == 0) continue;
        int32_t b = corner(face, k == 2 ? 0 : k + 1), c = corner(face, k == 0 ? 2 : k - 1);
        if (b == merged || c == merged) continue;
        Vector pb = at(b).position, pc = at(c).position;
        Vector before = cross(pb - from, pc - from), after = cross(pb - to, pc - to);
        double product = dot(before, after);
        if (product < 0.0 || product * product < TURNED * TURNED * dot(before, before) * dot(after, after)) return true;
    }
    return false;
}

// Merges v into u; faces of both die.
void Simplifier::merge(int32_t u, int32_t v, Vector to) {
    auto i = static_cast<size_t>(u), j = static_cast<size_t>(v);
    for (int32_t h = first_[j]; h != NOTHING; h = following_[static_cast<size_t>(h)]) {
        work_++;
        auto face = static_cast<size_t>(h / 3);
        if (alive_[face] == 0) continue;
        faces_[static_cast<size_t>(h)] = u;
        int32_t a = corner(face, 0), b = corner(face, 1), c = corner(face, 2);
        if (a == b || b == c || c == a) alive_[face] = 0;
    }
    following_[static_cast<size_t>(last_[i])] = first_[j];
    last_[i] = last_[j];
    at(u).position = to;
    at(u).quadric.add(at(v).quadric);
    versions_[j] = GONE;
    versions_[i]++;
    live_--;
    drop_dead(u);
}

// Takes dead faces out of the vertex' list; vertices that are left without faces go out of use.
void Simplifier::drop_dead(int32_t vertex) {
    auto v = static_cast<size_t>(vertex);
    int32_t kept = NOTHING;
    for (int32_t h = first_[v], next; h != NOTHING; h = next) {
        work_++;
        next = following_[static_cast<size_t>(h)];
        auto face = static_cast<size_t>(h / 3);
        if (alive_[face] != 0) {
            (kept == NOTHING ? first_[v] : following_[static_cast<size_t>(kept)]) = h;
            kept = h;
            continue;
        }
        for (size_t k = 0; k < 3; k++) {
            int32_t other = corner(face, k);
            uint32_t& version = versions_[static_cast<size_t>(other)];
            if (other == vertex || version == GONE || has_faces(other)) continue;
            version = GONE;
            live_--;
        }
    }
    if (kept == NOTHING) {
        versions_[v] = GONE;
        live_--;
        return;
    }
    following_[static_cast<size_t>(kept)] = NOTHING;
    last_[v] = kept;
}

bool Simplifier::has_faces(int32_t vertex) const {
    for (int32_t h = first_[static_cast<size_t>(vertex)]; h != NOTHING; h = following_[static_cast<size_t>(h)])
        if (alive_[static_cast<size_t>(h / 3)] != 0) return true;
    return false;
}

// Queues the edges from a vertex, if it is in use, to its neighbours of greater number than `above`.
void Simplifier::queue_around(int32_t vertex, int32_t above) {
    if (versions_[static_cast<size_t>(vertex)] == GONE) return;
    mark_++;
    for (int32_t h = first_[static_cast<size_t>(vertex)]; h != NOTHING; h = following_[static_cast<size_t>(h)]) {
        work_++;
        auto face = static_cast<size_t>(h / 3);
        if (alive_[face] == 0) continue;
        for (size_t k = 0; k < 3; k++) {
            int32_t other = corner(face, k);
            uint32_t& mark = marks_[static_cast<size_t>(other)];
            if (other == vertex || other <= above || mark == mark_) continue;
            mark = mark_;
            push(std::min(vertex, other), std::max(vertex, other));
        }
    }
}

bool Simplifier::current(const Entry& entry) const {
    uint32_t u = versions_[static_cast<size_t>(entry.u())], v = versions_[static_cast<size_t>(entry.v)];
    return u != GONE && v != GONE && u + v == entry.versions;
}

// When the heap is full, outdated entries are taken out first.
void Simplifier::push(int32_t u, int32_t v) {
    if (heap_.size() == heap_room_) {
        compact();
        if (heap_.size() == heap_room_) return;
    }
    Entry entry = entry_of(u, v);
    heap_.push(entry);
    Entry* heap = heap_.begin();
    size_t place = heap_.size() - 1;
    for (; place > 0 && entry.key < heap[(place - 1) / 4].key; place = (place - 1) / 4)
        heap[place] = heap[(place - 1) / 4];
    heap[place] = entry;
}

Simplifier::Entry Simplifier::pop() {
    Entry first = heap_[0], last = heap_.pop();
    if (!heap_.empty()) {
        heap_[0] = last;
        sink(0);
    }
    return first;
}

void Simplifier::sink(size_t place) {
    Entry* heap = heap_.begin();
    size_t size = heap_.size();
    if (place >= size) return;
    Entry entry = heap[place];
    while (true) {
        size_t child = 4 * place + 1;
        if (child >= size) break;
        size_t end = std::min(child + 4, size), least = child;
        for (size_t i = child + 1; i < end; i++) least = heap[i].key < heap[least].key ? i : least;
        if (!(heap[least].key < entry.key)) break;
        heap[place] = heap[least];
        place = least;
    }
    heap[place] = entry;
}

void Simplifier::compact() {
    size_t kept = 0;
    for (const Entry& entry : heap_)
        if (current(entry)) heap_[kept++] = entry;
    heap_.resize(kept);
    for (size_t i = kept / 4 + 1; i-- > 0;) sink(i);
}

} // namespace meshtide::inline MESHTIDE_ISA
