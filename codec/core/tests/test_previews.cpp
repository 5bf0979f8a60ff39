// surface/simplification.hpp, refit.hpp, previews.hpp: targets are met, shapes stay, fits are closer, hubs end in time.
#include "surface/previews.hpp"
#include "surfaces.hpp"

#include <algorithm>

namespace meshtide::testing {

namespace {

double volume(const Surface& surface) {
    double total = 0;
    for (size_t f = 0; f < surface.face_count(); f++)
        total += dot(surface.at(f, 0), cross(surface.at(f, 1), surface.at(f, 2))) / 6;
    return total;
}

uint32_t most_faces_at_an_edge(const TriangleMesh& mesh, Budget& budget) {
    Array<Edge> edges(budget);
    find_edges(mesh.faces.span(), mesh.vertices.size(), edges, budget);
    uint32_t most = 0;
    for (const Edge& edge : edges) most = std::max(most, edge.faces);
    return most;
}

// Closed surfaces stay closed and keep their volume, also when they were clustered first.
void test_spheres() {
    for (int splits : {4, 6}) {
        Budget budget(1 << 28);
        TriangleMesh sphere(budget), reduced(budget);
        QuantizedMesh quantized(budget);
        make_sphere(splits, sphere);
        quantize(sphere, 12, {-1, -1, -1}, 2, quantized, budget);
        Simplifier simplifier(quantized.positions.span(), quantized.faces.span(), 12, 300, budget);
        double whole = 4.18879 * 2047.5 * 2047.5 * 2047.5;
        size_t targets[] = {300, 60, 20};
        double tolerances[] = {0.03, 0.07, 0.17};
        for (size_t i = 0; i < 3; i++) {
            simplifier.reduce(targets[i], reduced);
            check_equal(reduced.vertices.size(), targets[i]);
            check_equal(reduced.faces.size() / 3, 2 * targets[i] - 4);
            check_equal(most_faces_at_an_edge(reduced, budget), 2u);
            check(std::abs(volume(reduced.surface()) / whole - 1) < tolerances[i]);
        }
    }
}

// Sheets keep their outline, and are glued to each other only when nothing else is left.
void test_sheets() {
    Budget budget(1 << 26);
    TriangleMesh sheets(budget), reduced(budget);
    for (int i = 0; i < 6; i++) {
        size_t first = sheets.vertices.size();
        make_sheet(12, sheets);
        for (size_t v = first; v < sheets.vertices.size(); v++) sheets.vertices[v].z = 2.0 * i;
    }
    QuantizedMesh quantized(budget);
    quantize(sheets, 12, {}, 11, quantized, budget);
    Simplifier simplifier(quantized.positions.span(), quantized.faces.span(), 12, 60, budget);
    simplifier.reduce(60, reduced);
    check_equal(most_faces_at_an_edge(reduced, budget), 2u);
    double area = 0;
    for (size_t f = 0; f < reduced.faces.size() / 3; f++) area += length(reduced.surface().normal(f)) / 2;
    check(area > 0.99 * 6 * 4095.0 * 4095.0);
    simplifier.reduce(10, reduced);
    check(reduced.vertices.size() <= 10);
}

// Any faces: no larger than before, canonical, and every vertex is in use.
void test_random_faces(Numbers& numbers) {
    for (int round = 0; round < 60; round++) {
        Budget budget(1 << 24);
        TriangleMesh soup(budget), reduced(budget);
        uint32_t vertices = 1 + numbers.below(300);
        for (uint32_t i = 0; i < vertices; i++)
            soup.vertices.push({unit_number(numbers), unit_number(numbers), unit_number(numbers)});
        for (uint32_t i = 3 * numbers.below(900); i > 0; i--)
            soup.faces.push(static_cast<int32_t>(numbers.below(vertices)));
        QuantizedMesh quantized(budget);
        quantize(soup, 6, {}, 1, quantized, budget);
        size_t target = 1 + numbers.below(50);
        Simplifier(quantized.positions.span(), quantized.faces.span(), 6, target, budget).reduce(target, reduced);
        check(reduced.faces.size() <= quantized.faces.size());
        Array<int32_t> faces(budget), used(budget);
        faces.copy(reduced.faces.span());
        canonical_faces(faces, reduced.vertices.size(), budget);
        check(std::equal(faces.begin(), faces.end(), reduced.faces.begin(), reduced.faces.end()));
        drop_unused(faces, reduced.vertices.size(), used, budget);
        check_equal(used.size(), reduced.vertices.size());
        for (Vector v : reduced.vertices) check(std::isfinite(v.x + v.y + v.z));
    }
}

// A coarse sphere grows to meet the fine one, and rounds to points of a grid that are better than the nearest.
void test_fits() {
    Budget budget(1 << 28);
    TriangleMesh fine(budget), coarse(budget);
    make_sphere(5, fine);
    make_sphere(2, coarse);
    for (TriangleMesh* mesh : {&fine, &coarse})
        for (Vector& v : mesh->vertices) v = v * 1000 + Vector{2013, 1977, 2045};
    ClosestPoints tree(fine.surface(), budget);
    Refitter refitter(tree, coarse.faces.span(), coarse.vertices.size(), budget);
    double before = refitter.distance(coarse.vertices.span());
    refitter.fit(coarse.vertices.span());
    check(refitter.distance(coarse.vertices.span()) < before / 2);

    double step = 4000.0 / 31;
    Array<int32_t> grid(budget);
    Array<Vector> nearest(budget), rounded(budget);
    refitter.round(coarse.vertices.span(), step, 31, grid);
    for (size_t v = 0; v < coarse.vertices.size(); v++) {
        Vector at = coarse.vertices[v] * (1 / step);
        nearest.push(Vector{std::floor(at.x + 0.5), std::floor(at.y + 0.5), std::floor(at.z + 0.5)} * step);
        rounded.push(Vector{static_cast<double>(grid[3 * v]), static_cast<double>(grid[3 * v + 1]),
                            static_cast<double>(grid[3 * v + 2])} *
                     step);
    }
    for (int32_t x : grid) check(x >= 0 && x <= 31);
    check(refitter.distance(rounded.span()) < 0.9 * refitter.distance(nearest.span()));
}

// Of several that are within a distance the smallest is taken; the callback is asked only where there is a choice.
void test_choice() {
    Budget budget(1 << 28);
    TriangleMesh sphere(budget);
    QuantizedMesh quantized(budget);
    make_sphere(5, sphere);
    for (Vector& v : sphere.vertices) v = v * (0.9 + 0.1 * std::sin(9 * v.x) * std::sin(9 * v.y));
    quantize(sphere, 12, {-1, -1, -1}, 2, quantized, budget);
    GridMesh mesh{quantized.positions.span(), quantized.faces.span(), 12};
    size_t asked = 0;
    auto size = [&](const Preview& preview) {
        asked++;
        return preview.vertex_count();
    };
    std::vector<Preview> chosen = choose_previews(mesh, size, budget);
    check(chosen.size() >= 2 && asked > 0);
    for (size_t i = 0; i < chosen.size(); i++) {
        check(chosen[i].vertex_count() <= quantized.vertex_count() / 18);
        check(i == 0 || chosen[i].vertex_count() > chosen[i - 1].vertex_count());
        for (int32_t x : chosen[i].positions) check(x >= 0 && x >> chosen[i].bits == 0);
    }
    check_equal(make_previews(mesh, {40, 40, 256, 1}, budget).size(), 2u);
    check_equal(make_previews({mesh.positions, {}, 12}, {40}, budget).size(), 0u);
}

// Thousands of faces at one vertex: what is looked at is bounded.
void test_hub() {
    Budget budget(1 << 26);
    TriangleMesh fan(budget), reduced(budget);
    QuantizedMesh quantized(budget);
    make_fan(4000, 0.5, fan);
    quantize(fan, 16, {-1, -1, -1}, 2, quantized, budget);
    Simplifier(quantized.positions.span(), quantized.faces.span(), 16, 400, budget).reduce(400, reduced);
    check(reduced.vertices.size() <= quantized.vertex_count() && !reduced.faces.empty());
}

} // namespace

void test_previews() {
    Numbers numbers;
    test_spheres();
    test_sheets();
    test_random_faces(numbers);
    test_fits();
    test_choice();
    test_hub();
}

} // namespace meshtide::testing
