// Predictors of a level's geometry in profile classic: polynomial and rational filters in K, applied to the extension.
//
// Balan & Taubin 2000, eqs. (2), (3), (5) to (9), (12), (15), (16); docs/format.md, Param and prediction. A polynomial
// of degree d costs d products with K; a rational filter adds one solution by conjugate gradients per coordinate.
// Chebyshev polynomials are taken of K - I, whose spectrum is [-1, 1]. A prediction is the same bits on every machine:
// encoder and decoder must agree on it.
#pragma once

#include "stream/header.hpp"
#include "surface/graph.hpp"

namespace meshtide::inline MESHTIDE_ISA {

enum class FilterBasis { power, chebyshev };

constexpr size_t LARGEST_DEGREE = 15;
constexpr size_t LARGEST_DENOMINATOR_DEGREE = 4;

struct Filter {
    FilterKind kind = FilterKind::polynomial;
    FilterBasis basis = FilterBasis::power;
    size_t degree = 3;             // of the polynomial or the numerator
    size_t denominator_degree = 0; // of `rational`, 1 to 4
    double taubin_lambda = 0, taubin_mu = 0;

    // Coefficients for each coordinate; of a rational filter the numerator's, then q_1, q_2, ... of the denominator
    // 1 + q_1 K + q_2 K^2 + ...
    size_t coefficient_count() const {
        if (kind == FilterKind::polynomial) return degree + 1;
        return kind == FilterKind::rational ? degree + 1 + denominator_degree : 0;
    }
};

// Fails unless there are as many coefficients as the filter takes, and it can use them. Malformed: they are not finite,
// or a denominator is not safe.
void check_coefficients(const Filter& filter, Span<const float> coefficients);

// The filtered extension; a vertex without neighbours stays where it is. Coefficients are those of x, then y, then z.
// With coefficients of a stream the result may lie anywhere: it is to be bounded before it becomes integers. Checks the
// coefficients.
void predict(const Graph& graph, const Filter& filter, Span<const float> coefficients, Span<const Vector> extension,
             Span<Vector> prediction, Budget& budget);

// Whether 1 + q_1 t + q_2 t^2 + ... is provably positive on [0, 2], and its solution provably quick: its values on a
// fine grid, less what a Lipschitz constant allows between the points, stay above 1/256, and their ratio below 256.
bool is_safe_denominator(Span<const float> denominator);

// Solves (1 + q_1 K + q_2 K^2 + ...) x = values, to a relative residual of 1e-11, in place; the denominator is safe.
void divide(const Graph& graph, Span<const float> denominator, Span<double> values, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
