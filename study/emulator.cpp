// SPDX-License-Identifier: Apache-2.0
#include "study/emulator.h"

#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "core/error.h"

namespace nephos {
namespace {

constexpr int kHighestDegree = 5;

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

// All monomials of the coordinates up to a degree, 1 first.
void add_terms(const Box& box, std::span<const double> point, std::size_t axis, int degree, double product,
               std::vector<double>& terms) {
    if (axis == point.size()) {
        terms.push_back(product);
        return;
    }
    for (int power = 0; power <= degree; ++power) {
        add_terms(box, point, axis + 1, degree - power, product, terms);
        product *= (point[axis] - box.middle[axis]) * box.scale[axis];
    }
}

Eigen::VectorXd terms_at(const Box& box, std::span<const double> point, int degree) {
    std::vector<double> terms;
    add_terms(box, point, 0, degree, 1, terms);
    return Eigen::Map<Eigen::VectorXd>(terms.data(), Eigen::Index(terms.size()));
}

std::size_t term_count(std::size_t dimensions, int degree) {
    std::size_t count = 1;  // binomial(dimensions + degree, degree)
    for (std::size_t n = 1; n <= std::size_t(degree); ++n) count = count * (dimensions + n) / n;
    return count;
}

}  // namespace

struct Emulator::Fit {
    Box box;
    int degree = 1;
    double noise = 0;
    double doubt = 1;  // of the noise, which few values tell only roughly: the variance of Student's t
    std::vector<double> left_out;
    Eigen::VectorXd coefficients;
    Eigen::MatrixXd inverse;  // of the normal equations
};

Emulator::Emulator(std::span<const double> points, std::span<const double> values, std::size_t dimensions) {
    const std::size_t n = values.size();
    if (n < dimensions + 3)
        throw Error(ErrorCode::usage, "too few runs have a value to fit anything to them");
    const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(n));
    const Box box(points, dimensions);
    double best = std::numeric_limits<double>::infinity();
    for (int degree = 1; degree <= kHighestDegree; ++degree) {
        const std::size_t terms = term_count(dimensions, degree);
        if (degree > 1 && 2 * terms > n) break;
        auto fit = std::make_unique<Fit>(Fit{box, degree, 0, 1, {}, {}, {}});
        Eigen::MatrixXd x = Eigen::MatrixXd::Zero(Eigen::Index(n), Eigen::Index(terms));
        for (std::size_t row = 0; row < n; ++row)
            x.row(Eigen::Index(row)) = terms_at(box, points.subspan(row * dimensions, dimensions), degree);
        const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(Eigen::Index(terms), Eigen::Index(terms));
        // A trace of ridge: points that lie along a line leave no term without a value.
        const Eigen::MatrixXd normal = x.transpose() * x + 1e-10 * double(n) * identity;
        fit->inverse = normal.ldlt().solve(identity);
        fit->coefficients = fit->inverse * (x.transpose() * y);
        const Eigen::VectorXd residuals = y - x * fit->coefficients;
        const double freedom = double(n - std::min(terms, n - 1));
        fit->noise = std::sqrt(residuals.squaredNorm() / freedom);
        fit->doubt = freedom > 2 ? freedom / (freedom - 2) : 3;
        // What each value is off a fit to all the others.
        double left_out = 0;
        for (Eigen::Index row = 0; row < Eigen::Index(n); ++row) {
            const double leverage = std::min(0.99, x.row(row).dot(fit->inverse * x.row(row).transpose()));
            fit->left_out.push_back(residuals[row] / (1 - leverage));
            left_out += fit->left_out.back() * fit->left_out.back();
        }
        // A higher degree must earn its place.
        if (left_out < 0.9 * best) {
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
    const Eigen::VectorXd terms = terms_at(fit_->box, point, fit_->degree);
    return {terms.dot(fit_->coefficients), fit_->noise * fit_->noise * leverage(point)};
}

double Emulator::leverage(std::span<const double> point) const {
    const Eigen::VectorXd terms = terms_at(fit_->box, point, fit_->degree);
    return fit_->doubt * std::max(0.0, terms.dot(fit_->inverse * terms));
}

double Emulator::noise() const { return fit_->noise; }
const std::vector<double>& Emulator::left_out() const { return fit_->left_out; }
int Emulator::degree() const { return fit_->degree; }

}  // namespace nephos
