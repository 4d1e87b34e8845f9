// SPDX-License-Identifier: Apache-2.0
#include "study/student.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace nephos {

double student_quantile(int degrees, double level) {
    const boost::math::students_t_distribution<double> t(degrees);
    return boost::math::quantile(t, 0.5 + level / 2);
}

double chi_squared_probability(int degrees, double x) {
    const boost::math::chi_squared_distribution<double> chi_squared(degrees);
    return boost::math::cdf(chi_squared, x);
}

}  // namespace nephos
