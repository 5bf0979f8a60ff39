// surface/closest_points.hpp, samples.hpp, distance.hpp: against plain distances of every triangle, and few visits.
#include "surface/closest_points.hpp"
#include "surface/distance.hpp"
#include "surfaces.hpp"

#include <algorithm>

namespace meshtide::testing {

namespace {

double plain_distance(const Surface& surface, Vector point) {
    double least = INFINITY;
    for (size_t f = 0; f < surface.face_count(); f++)
        least = std::min(least, closest_on_face(surface, f, point).squared);
    return least;
}

bool close(double found, double expected) { return std::abs(found - expected) <= 1e-12 + 1e-9 * std::abs(expected); }

// Nothing is closer than what is found, wherever a search begins.
void test_random_triangles(Numbers& numbers) {
    for (int round = 0; round < 60; round++) {
        Budget budget(1 << 24);
        TriangleMesh mesh(budget);
        uint32_t vertices = 3 + numbers.below(40), faces = 1 + numbers.below(60);
        double flatness = round % 3 == 0 ? 1e-3 : 1.0, size = round % 4 == 0 ? 1e6 : 1.0;
        auto any = [&] { return (unit_number(numbers) - 0.5) * size; };
        for (uint32_t i = 0; i < vertices; i++) mesh.vertices.push({any(), any() * flatness, any()});
        for (uint32_t i = 0; i < 3 * faces; i++) mesh.faces.push(static_cast<int32_t>(numbers.below(vertices)));
        ClosestPoints tree(mesh.surface(), budget);
        CurvePoints points(budget);
        for (int i = 0; i < 30; i++)
            points.at.push({any() * 2, any() * 2, any() * 2}), points.keys.push(numbers.below(9));
        double sum = 0, largest = 0;
        for (Vector point : points.at) {
            double expected = plain_distance(mesh.surface(), point);
            Closest found = tree.closest(point, numbers.below(faces));
            check(close(found.squared, expected));
            Vector off = point - found.foot.on(mesh.surface());
            check(close(dot(off, off), expected));
            Closest above = tree.closest(point, 0, 0.5 * expected + 1e-9);
            check(above.foot.face >= 0 && close(above.squared, expected));
            check_equal(tree.closest(point, 0, 1.1 * expected + 1e-3 * size * size).squared, 0.0);
            sum += expected, largest = std::max(largest, expected);
        }
        Spread spread = tree.spread(points);
        check(close(spread.mean, sum / 30) && close(spread.largest, largest));
        check(close(tree.largest(points, 0), largest));
        check_equal(tree.largest(points, 2 * largest + 1), 2 * largest + 1);
    }
}

// Samples are on the surface, and each half of it has as many as its area tells; vertices are all there, or every j-th.
void test_samples() {
    Budget budget(1 << 24);
    TriangleMesh mesh(budget);
    make_sheet(2, mesh);
    for (Vector at : {Vector{10, 0, 0}, Vector{13, 0, 0}, Vector{10, 1, 0}}) mesh.vertices.push(at);
    mesh.vertices.push({50, 50, 50}); // which no face uses
    add_face(mesh, 4, 5, 6);
    ClosestPoints tree(mesh.surface(), budget);
    CurvePoints points(budget), again(budget);
    tree.sampled(4000, 7, points, budget);
    tree.sampled(4000, 7, again, budget);
    int near = 0;
    for (size_t i = 0; i < 4000; i++) {
        near += points.at[i].x < 5;
        check(plain_distance(mesh.surface(), points.at[i]) < 1e-20 && dot(points.at[i], again.at[i]) >= 0);
        check(points.at[i].x == again.at[i].x && points.at[i].y == again.at[i].y);
    }
    check(std::abs(near - 1600) <= 2);
    check(std::is_sorted(points.keys.begin(), points.keys.end()));
    size_t limits[] = {7, 6, 1}, counts[] = {7, 4, 1};
    for (size_t i = 0; i < 3; i++) {
        tree.used_vertices(limits[i], points, budget);
        check_equal(points.at.size(), counts[i]);
    }
}

// Thousands of slivers have boxes that all hold the same points: beams keep most of them away.
void test_slivers() {
    for (double height : {0.0, 1.0}) {
        Budget budget(1 << 26);
        TriangleMesh fan(budget);
        make_fan(20000, height, fan);
        ClosestPoints tree(fan.surface(), budget);
        CurvePoints points(budget);
        tree.sampled(1000, 1, points, budget);
        check(tree.visits_per_search(points.at.span()) < 150);
    }
    Budget budget(1 << 26);
    TriangleMesh sphere(budget);
    make_sphere(5, sphere);
    ClosestPoints tree(sphere.surface(), budget);
    CurvePoints points(budget);
    tree.sampled(1000, 1, points, budget);
    check(tree.visits_per_search(points.at.span()) < 30);
}

// A surface measured against itself, moved, and with one vertex far away.
void test_distances() {
    Budget budget(1 << 24);
    TriangleMesh sheet(budget), other(budget);
    make_sheet(4, sheet);
    DistanceMeter meter(sheet.surface(), {}, budget);
    check_equal(meter.measure(sheet.surface(), budget).maximum, 0.0);
    auto raised = [&](double height) {
        other.faces.copy(sheet.faces.span());
        other.vertices.clear();
        for (Vector v : sheet.vertices) other.vertices.push(v + Vector{0, 0, height});
        return meter.measure(other.surface(), budget);
    };
    double diagonal = std::sqrt(18.0);
    for (double height : {1e-6, 0.1, 5.0}) {
        Distortion found = raised(height);
        check(std::abs(found.rms * diagonal / height - 1) < 1e-6 && std::abs(found.maximum / found.rms - 1) < 1e-6);
    }
    raised(0.01);
    other.vertices[5].z = 2;
    check(std::abs(meter.measure(other.surface(), budget).maximum * diagonal - 2) < 1e-9);
    Surface points{sheet.vertices.span(), {}}; // without faces: from vertex to vertex
    check(std::abs(meter.measure(points, budget).maximum * diagonal - std::sqrt(0.5)) < 0.02);
    check_fails(Fault::argument, [&] { meter.measure({}, budget); });
    other.vertices[0].x = INFINITY;
    check_fails(Fault::argument, [&] { meter.measure(other.surface(), budget); });
    check_fails(Fault::argument, [&] { DistanceMeter(sheet.surface(), {0, 1, 1}, budget); });
}

} // namespace

void test_closest_points() {
    Numbers numbers;
    test_random_triangles(numbers);
    test_samples();
    test_slivers();
    test_distances();
}

} // namespace meshtide::testing
