// SPDX-License-Identifier: Apache-2.0
#include "study/emulator.h"

#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "core/error.h"

namespace nephos {
namespace {

constexpr int kHighestDegree = 5;

// All monomials of 2 x - 1 up to a degree, 1 first.
void add_terms(std::span<const double> point, std::size_t axis, int degree, double product,
               std::vector<double>& terms) {
    if (axis == point.size()) {
        terms.push_back(product);
        return;
    }
    for (int power = 0; power <= degree; ++power) {
        add_terms(point, axis + 1, degree - power, product, terms);
        product *= 2 * point[axis] - 1;
    }
}

Eigen::VectorXd terms_at(std::span<const double> point, int degree) {
    std::vector<double> terms;
    add_terms(point, 0, degree, 1, terms);
    return Eigen::Map<Eigen::VectorXd>(terms.data(), Eigen::Index(terms.size()));
}

std::size_t term_count(std::size_t dimensions, int degree) {
    std::size_t count = 1;  // binomial(dimensions + degree, degree)
    for (std::size_t n = 1; n <= std::size_t(degree); ++n) count = count * (dimensions + n) / n;
    return count;
}

}  // namespace

struct Emulator::Fit {
    int degree = 1;
    double noise = 0;
    Eigen::VectorXd coefficients;
    Eigen::MatrixXd inverse;  // of the normal equations
};

Emulator::Emulator(std::span<const double> points, std::span<const double> values, std::size_t dimensions) {
    const std::size_t n = values.size();
    if (n < dimensions + 3)
        throw Error(ErrorCode::usage, "too few runs have a value to fit anything to them");
    const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(n));
    double best = std::numeric_limits<double>::infinity();
    for (int degree = 1; degree <= kHighestDegree; ++degree) {
        const std::size_t terms = term_count(dimensions, degree);
        if (degree > 1 && 2 * terms > n) break;
        auto fit = std::make_unique<Fit>();
        fit->degree = degree;
        Eigen::MatrixXd x = Eigen::MatrixXd::Zero(Eigen::Index(n), Eigen::Index(terms));
        for (std::size_t row = 0; row < n; ++row)
            x.row(Eigen::Index(row)) = terms_at(points.subspan(row * dimensions, dimensions), degree);
        const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(Eigen::Index(terms), Eigen::Index(terms));
        // A trace of ridge: points that lie along a line leave no term without a value.
        const Eigen::MatrixXd normal = x.transpose() * x + 1e-10 * double(n) * identity;
        fit->inverse = normal.ldlt().solve(identity);
        fit->coefficients = fit->inverse * (x.transpose() * y);
        const Eigen::VectorXd residuals = y - x * fit->coefficients;
        fit->noise = std::sqrt(residuals.squaredNorm() / double(n - std::min(terms, n - 1)));
        // What each value is off a fit to all the others.
        double left_out = 0;
        for (Eigen::Index row = 0; row < Eigen::Index(n); ++row) {
            const double leverage = std::min(0.99, x.row(row).dot(fit->inverse * x.row(row).transpose()));
            left_out += residuals[row] * residuals[row] / ((1 - leverage) * (1 - leverage));
        }
        // A higher degree must earn its place.
        if (left_out < 0.95 * best) {
            best = left_out;
            fit_ = std::move(fit);
        }
    }
    if (!fit_) throw Error(ErrorCode::usage, "the runs have values that no polynomial fits");
}

Emulator::~Emulator() = default;
Emulator::Emulator(Emulator&&) noexcept = default;
Emulator& Emulator::operator=(Emulator&&) noexcept = default;

Emulator::Prediction Emulator::at(std::span<const double> point) const {
    const Eigen::VectorXd terms = terms_at(point, fit_->degree);
    return {terms.dot(fit_->coefficients),
            fit_->noise * fit_->noise * std::max(0.0, terms.dot(fit_->inverse * terms))};
}

double Emulator::noise() const { return fit_->noise; }
int Emulator::degree() const { return fit_->degree; }

}  // namespace nephos
