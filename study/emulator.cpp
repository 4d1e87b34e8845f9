// SPDX-License-Identifier: Apache-2.0
#include "study/emulator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include <Eigen/Dense>

#include "core/error.h"

namespace nephos {
namespace {

constexpr int kHighestDegree = 5;
constexpr double kEarned = 0.9;  // of the squares left out

// Coordinates over the box of some points: -1 to 1 along each axis; 0 where all points have the same place.
struct Box {
    std::vector<double> middle, scale;

    Box(std::span<const double> points, std::size_t dimensions) : middle(dimensions), scale(dimensions) {
        for (std::size_t d = 0; d < dimensions; ++d) {
            double low = points[d], high = points[d];
            for (std::size_t n = d; n < points.size(); n += dimensions) {
                low = std::min(low, points[n]);
                high = std::max(high, points[n]);
            }
            middle[d] = (low + high) / 2;
            scale[d] = high > low ? 2 / (high - low) : 0;
        }
    }
};

using Exponents = std::vector<std::uint8_t>;  // of each coordinate in a term

// All monomials up to a degree of the first `mixed` coordinates of an order, 1 first, and the other coordinates themselves.
std::vector<Exponents> terms_of(const std::vector<std::size_t>& order, std::size_t mixed, int degree) {
    std::vector<Exponents> terms{Exponents(order.size(), 0)};
    for (std::size_t n = 0; n < order.size(); ++n) {
        const int highest = n < mixed ? degree : 1;
        for (std::size_t term = 0, had = terms.size(); term < had; ++term) {
            int sum = 0;
            for (const std::uint8_t exponent : terms[term]) sum += exponent;
            for (int power = 1; power <= (n < mixed ? highest - sum : sum == 0 ? 1 : 0); ++power) {
                terms.push_back(terms[term]);
                terms.back()[order[n]] = std::uint8_t(power);
            }
        }
    }
    return terms;
}

// The powers of each coordinate alone.
std::vector<Exponents> powers_of(std::size_t dimensions, int degree) {
    std::vector<Exponents> terms{Exponents(dimensions, 0)};
    for (std::size_t d = 0; d < dimensions; ++d)
        for (int power = 1; power <= degree; ++power) {
            terms.emplace_back(dimensions, 0);
            terms.back()[d] = std::uint8_t(power);
        }
    return terms;
}

Eigen::VectorXd terms_at(const Box& box, std::span<const double> point, const std::vector<Exponents>& terms) {
    std::vector<std::array<double, kHighestDegree + 1>> powers(point.size());
    for (std::size_t d = 0; d < point.size(); ++d) {
        powers[d][0] = 1;
        for (std::size_t n = 1; n < powers[d].size(); ++n)
            powers[d][n] = powers[d][n - 1] * (point[d] - box.middle[d]) * box.scale[d];
    }
    Eigen::VectorXd values(Eigen::Index(terms.size()));
    for (std::size_t n = 0; n < terms.size(); ++n) {
        double product = 1;
        for (std::size_t d = 0; d < point.size(); ++d) product *= powers[d][terms[n][d]];
        values[Eigen::Index(n)] = product;
    }
    return values;
}

}  // namespace

struct Emulator::Fit {
    Box box;
    std::vector<Exponents> terms;
    int degree = 1;
    double noise = 0;
    double doubt = 1;   // of the noise, which few values tell only roughly: the variance of Student's t
    double misfit = 0;  // standard deviation that the errors of the values do not explain
    std::vector<double> left_out;
    double left_out_squares = 0;
    Eigen::VectorXd coefficients;
    Eigen::MatrixXd inverse;  // of the normal equations

    Eigen::MatrixXd matrix(std::span<const double> points, std::size_t rows) const {
        const std::size_t dimensions = points.size() / rows;
        Eigen::MatrixXd x(Eigen::Index(rows), Eigen::Index(terms.size()));
        for (std::size_t row = 0; row < rows; ++row)
            x.row(Eigen::Index(row)) = terms_at(box, points.subspan(row * dimensions, dimensions), terms);
        return x;
    }

    void solve(std::span<const double> points, const Eigen::VectorXd& y, double square_error) {
        const auto n = std::size_t(y.size());
        const auto count = Eigen::Index(terms.size());
        const Eigen::MatrixXd x = matrix(points, n);
        const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(count, count);
        // A trace of ridge: points that lie along a line leave no term without a value.
        const Eigen::MatrixXd normal = x.transpose() * x + 1e-10 * double(n) * identity;
        inverse = normal.ldlt().solve(identity);
        coefficients = inverse * (x.transpose() * y);
        const Eigen::VectorXd residuals = y - x * coefficients;
        const double freedom = double(n - std::min(terms.size(), n - 1));
        noise = std::sqrt(residuals.squaredNorm() / freedom);
        doubt = freedom > 2 ? freedom / (freedom - 2) : 3;
        // What each value is off a fit to all the others.
        for (Eigen::Index row = 0; row < y.size(); ++row) {
            const double lever = std::min(0.99, x.row(row).dot(inverse * x.row(row).transpose()));
            left_out.push_back(residuals[row] / (1 - lever));
            left_out_squares += left_out.back() * left_out.back();
        }
        // A sum of squares of so many degrees of freedom scatters by sqrt(2 / freedom) of itself. Terms that were chosen for these
        // values miss others by more: by what was left out.
        const double chance = square_error * (1 + 2 * std::sqrt(2 / freedom));
        const double missed = std::max(noise * noise, left_out_squares / double(n));
        misfit = noise * noise > chance ? std::sqrt(missed - square_error) : 0;
    }
};

namespace {

// The coordinates in the order of what they explain, most first: the sum of squares of the part that powers of it have in a fit
// to powers of each.
template <typename Fit>
std::vector<std::size_t> order_of(const Box& box, std::span<const double> points, const Eigen::VectorXd& y) {
    const std::size_t dimensions = box.middle.size();
    const auto n = std::size_t(y.size());
    int degree = 3;
    while (degree > 1 && 2 * (1 + dimensions * std::size_t(degree)) > n) --degree;
    Fit fit{box, powers_of(dimensions, degree)};
    fit.solve(points, y, 0);
    const Eigen::MatrixXd x = fit.matrix(points, n);
    std::vector<double> explained;
    for (std::size_t d = 0; d < dimensions; ++d) {
        const Eigen::Index first = Eigen::Index(1 + d * std::size_t(degree));
        const Eigen::VectorXd part = x.middleCols(first, degree) * fit.coefficients.segment(first, degree);
        explained.push_back((part.array() - part.mean()).square().sum());
    }
    std::vector<std::size_t> order(dimensions);
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order,
                             [&](std::size_t a, std::size_t b) { return explained[a] > explained[b]; });
    return order;
}

}  // namespace

Emulator::Emulator(std::span<const double> points, std::span<const double> values,
                   std::span<const double> errors, std::size_t dimensions) {
    const std::size_t n = values.size();
    if (n < dimensions + 3)
        throw Error(ErrorCode::usage, "too few runs have a value to fit anything to them");
    const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(n));
    double square_error = 0;
    for (const double error : errors)
        if (std::isfinite(error)) square_error += error * error / double(n);
    const Box box(points, dimensions);
    const std::vector<std::size_t> order = order_of<Fit>(box, points, y);
    std::vector<std::pair<std::vector<Exponents>, int>> forms{{powers_of(dimensions, 1), 1}};
    for (std::size_t mixed = 1; mixed <= dimensions; ++mixed)
        for (int degree = 2; degree <= kHighestDegree; ++degree) {
            std::vector<Exponents> terms = terms_of(order, mixed, degree);
            if (2 * terms.size() > n) break;
            forms.emplace_back(std::move(terms), degree);
        }
    std::ranges::stable_sort(forms,
                             [](const auto& a, const auto& b) { return a.first.size() < b.first.size(); });
    double best = std::numeric_limits<double>::infinity();
    for (auto& [terms, degree] : forms) {
        auto fit = std::make_unique<Fit>(Fit{box, std::move(terms), degree});
        fit->solve(points, y, square_error);
        // More terms must earn their place.
        if (fit->left_out_squares < kEarned * best) {
            best = fit->left_out_squares;
            fit_ = std::move(fit);
        }
    }
    if (!fit_) throw Error(ErrorCode::usage, "the runs have values that no polynomial fits");
}

Emulator::~Emulator() = default;
Emulator::Emulator(Emulator&&) noexcept = default;
Emulator& Emulator::operator=(Emulator&&) noexcept = default;

Emulator::Prediction Emulator::at(std::span<const double> point) const {
    const Eigen::VectorXd terms = terms_at(fit_->box, point, fit_->terms);
    return {terms.dot(fit_->coefficients),
            fit_->noise * fit_->noise * fit_->doubt * std::max(0.0, terms.dot(fit_->inverse * terms)) +
                fit_->misfit * fit_->misfit};
}

double Emulator::leverage(std::span<const double> point) const {
    const Eigen::VectorXd terms = terms_at(fit_->box, point, fit_->terms);
    return fit_->doubt * std::max(0.0, terms.dot(fit_->inverse * terms));
}

double Emulator::noise() const { return fit_->noise; }
double Emulator::misfit() const { return fit_->misfit; }
const std::vector<double>& Emulator::left_out() const { return fit_->left_out; }
int Emulator::degree() const { return fit_->degree; }

}  // namespace nephos
