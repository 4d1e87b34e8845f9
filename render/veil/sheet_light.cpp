// SPDX-License-Identifier: Apache-2.0
#include "render/veil/sheet_light.h"

#include <cmath>

namespace nephos {

SheetLight::SheetLight(double depth, double sun_cosine, double ground_albedo) : m_(sun_cosine) {
    const double left = std::exp(-depth / m_), open = 1 - ground_albedo,
                 passed = 1 / (1 + open * 0.75 * depth);
    below_sky_ = passed;
    below_sun_ = passed * (0.5 * m_ * (1 + left) + 0.75 * m_ * m_ * (1 - left));
    flux_sky_ = open * below_sky_;
    flux_sun_ = open * below_sun_;
}

double SheetLight::by_sun(double t) const {
    return -0.5 * (flux_sun_ - m_) - 0.75 * flux_sun_ * t + 0.75 * m_ * m_ * (1 - std::exp(-t / m_));
}

double SheetLight::by_sky(double t) const { return 1 - 0.5 * flux_sky_ - 0.75 * flux_sky_ * t; }

}  // namespace nephos
