#include "surface/filters.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr double RELATIVE_RESIDUAL = 1e-11; // where conjugate gradients stop, in the norm weighted by degrees
constexpr size_t MOST_ITERATIONS = 256;     // enough for that at the largest ratio of values that is admitted
constexpr size_t GRID_INTERVALS = 4096;     // where a denominator is evaluated on [0, 2] to bound it
constexpr double SMALLEST_DENOMINATOR = 1.0 / 256;
constexpr double LARGEST_DENOMINATOR_RATIO = 256.0;

// One coefficient for each coordinate.
struct Coefficients {
    Span<const float> all;
    size_t stride;

    Vector scaled(size_t power, Vector v) const {
        return {static_cast<double>(all[power]) * v.x, static_cast<double>(all[stride + power]) * v.y,
                static_cast<double>(all[2 * stride + power]) * v.z};
    }
};

// sum_k c_k K^k x, by Horner's rule.
void power_polynomial(const Graph& graph, size_t degree, const Coefficients& c, Span<const Vector> x,
                      Span<Vector> result, Span<Vector> product) {
    for (size_t v = 0; v < x.size(); v++) result[v] = c.scaled(degree, x[v]);
    for (size_t power = degree; power-- > 0;) {
        apply_k(graph, Span<const Vector>(result), product);
        for (size_t v = 0; v < x.size(); v++) result[v] = product[v] + c.scaled(power, x[v]);
    }
}

// sum_k c_k T_k(K - I) x, by Clenshaw's rule.
void chebyshev_polynomial(const Graph& graph, size_t degree, const Coefficients& c, Span<const Vector> x,
                          Span<Vector> result, Span<Vector> product, Budget& budget) {
    Array<Vector> later(budget);
    later.assign(x.size(), Vector{});
    for (size_t v = 0; v < x.size(); v++) result[v] = c.scaled(degree, x[v]);
    for (size_t order = degree; order-- > 0;) {
        double factor = order > 0 ? 2.0 : 1.0;
        apply_k(graph, Span<const Vector>(result), product);
        for (size_t v = 0; v < x.size(); v++) {
            Vector shifted = (product[v] - result[v]) * factor;
            Vector value = (shifted - later[v]) + c.scaled(order, x[v]);
            later[v] = result[v];
            result[v] = value;
        }
    }
}

// What conjugate gradients work with. K is self-adjoint in the inner product weighted by degrees, so Q(K) is symmetric
// and, where Q > 0 on [0, 2], positive definite there.
struct Denominator {
    const Graph& graph;
    Span<const float> coefficients;
    Span<double> product; // room to work in

    // (1 + q_1 K + q_2 K^2 + ...) values, by Horner's rule.
    void apply(Span<const double> values, Span<double> result) const {
        size_t degree = coefficients.size();
        auto q = [&](size_t power) { return static_cast<double>(coefficients[power]); };
        for (size_t v = 0; v < values.size(); v++) result[v] = q(degree - 1) * values[v];
        for (size_t power = degree; power-- > 0;) {
            double factor = power > 0 ? q(power - 1) : 1.0;
            apply_k(graph, Span<const double>(result), product);
            for (size_t v = 0; v < values.size(); v++) result[v] = product[v] + factor * values[v];
        }
    }
    double inner(Span<const double> a, Span<const double> b) const {
        double total = 0.0;
        for (size_t v = 0; v < a.size(); v++) total += static_cast<double>(graph.degree(v)) * (a[v] * b[v]);
        return total;
    }
};

} // namespace

void check_coefficients(const Filter& filter, Span<const float> coefficients) {
    size_t stride = filter.coefficient_count();
    if (filter.degree > LARGEST_DEGREE || filter.denominator_degree > LARGEST_DENOMINATOR_DEGREE ||
        coefficients.size() != 3 * stride)
        fail(Fault::argument, "a filter and its coefficients do not fit");
    for (float c : coefficients) expect(std::isfinite(c), "a coefficient that is not finite");
    for (size_t axis = 0; axis < 3 && filter.kind == FilterKind::rational; axis++)
        expect(is_safe_denominator(coefficients.part(axis * stride + filter.degree + 1, filter.denominator_degree)),
               "a denominator that is not safely positive");
}

void predict(const Graph& graph, const Filter& filter, Span<const float> coefficients, Span<const Vector> extension,
             Span<Vector> prediction, Budget& budget) {
    size_t n = extension.size(), stride = filter.coefficient_count();
    check_coefficients(filter, coefficients);
    if (graph.vertex_count() != n || prediction.size() != n)
        fail(Fault::argument, "a filter and what it is applied to do not fit");
    Array<Vector> product(budget);
    product.resize(n);
    switch (filter.kind) {
    case FilterKind::zeroth:
        for (size_t v = 0; v < n; v++) prediction[v] = extension[v];
        return;
    case FilterKind::gaussian:
        apply_k(graph, extension, product.span());
        for (size_t v = 0; v < n; v++) prediction[v] = extension[v] - product[v];
        return;
    case FilterKind::taubin: {
        Array<Vector> raised(budget);
        raised.resize(n);
        apply_k(graph, extension, product.span());
        for (size_t v = 0; v < n; v++) raised[v] = extension[v] + product[v] * filter.taubin_mu;
        apply_k(graph, raised.span(), product.span());
        for (size_t v = 0; v < n; v++) prediction[v] = raised[v] - product[v] * filter.taubin_lambda;
        return;
    }
    case FilterKind::polynomial:
    case FilterKind::rational:
        break;
    }
    Coefficients c{coefficients, stride};
    if (filter.basis == FilterBasis::power)
        power_polynomial(graph, filter.degree, c, extension, prediction, product.span());
    else
        chebyshev_polynomial(graph, filter.degree, c, extension, prediction, product.span(), budget);
    for (size_t axis = 0; axis < 3 && filter.kind == FilterKind::rational; axis++) {
        auto denominator = coefficients.part(axis * stride + filter.degree + 1, filter.denominator_degree);
        double Vector::*along = axis == 0 ? &Vector::x : axis == 1 ? &Vector::y : &Vector::z;
        Array<double> column(budget);
        column.resize(n);
        for (size_t v = 0; v < n; v++) column[v] = prediction[v].*along;
        divide(graph, denominator, column.span(), budget);
        for (size_t v = 0; v < n; v++) prediction[v].*along = column[v];
    }
    for (size_t v = 0; v < n; v++)
        if (graph.degree(v) == 0) prediction[v] = extension[v];
}

bool is_safe_denominator(Span<const float> denominator) {
    double steepest = 0.0, doubled = 1.0;
    for (size_t power = 1; power <= denominator.size(); power++, doubled *= 2.0) {
        auto q = static_cast<double>(denominator[power - 1]);
        if (!std::isfinite(q)) return false;
        steepest += static_cast<double>(power) * std::abs(q) * doubled;
    }
    double lowest = INFINITY, highest = -INFINITY;
    for (size_t i = 0; i <= GRID_INTERVALS; i++) {
        double point = static_cast<double>(i) * (2.0 / GRID_INTERVALS), value = 0.0;
        for (size_t power = denominator.size(); power > 0; power--)
            value = value * point + static_cast<double>(denominator[power - 1]);
        value = value * point + 1.0;
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
    }
    double slack = steepest / GRID_INTERVALS; // half the distance of two points, times the slope
    lowest -= slack;
    highest += slack;
    return lowest >= SMALLEST_DENOMINATOR && highest <= LARGEST_DENOMINATOR_RATIO * lowest;
}

void divide(const Graph& graph, Span<const float> coefficients, Span<double> values, Budget& budget) {
    if (std::all_of(coefficients.begin(), coefficients.end(), [](float q) { return q == 0.0f; })) return;
    size_t n = values.size();
    Array<double> product(budget), image(budget), residual(budget), step(budget);
    for (Array<double>* room : {&product, &image, &residual, &step}) room->resize(n);
    Denominator q{graph, coefficients, product.span()};
    // The search starts at the right side: vertices without neighbours, of weight 0, are solved by that.
    q.apply(values, image.span());
    for (size_t v = 0; v < n; v++) step[v] = residual[v] = values[v] - image[v];
    double goal = RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * q.inner(values, values);
    double energy = q.inner(residual.span(), residual.span());
    for (size_t iteration = 0; iteration < MOST_ITERATIONS && energy > goal; iteration++) {
        q.apply(step.span(), image.span());
        double curvature = q.inner(step.span(), image.span());
        if (!(curvature > 0.0)) break;
        double far = energy / curvature;
        for (size_t v = 0; v < n; v++) {
            values[v] += far * step[v];
            residual[v] -= far * image[v];
        }
        double next = q.inner(residual.span(), residual.span()), growth = next / energy;
        energy = next;
        for (size_t v = 0; v < n; v++) step[v] = residual[v] + growth * step[v];
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
