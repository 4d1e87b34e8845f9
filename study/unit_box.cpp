// SPDX-License-Identifier: Apache-2.0
#include "study/unit_box.h"

#include <algorithm>
#include <cmath>

namespace nephos {

bool UnitBox::holds(const Point& point) const {
    for (std::size_t n = 0; n < point.size(); ++n)
        if (point[n] < low[n] || point[n] > high[n]) return false;
    return true;
}

bool UnitBox::is_whole() const {
    return std::ranges::all_of(low, [](double x) { return x == 0; }) &&
           std::ranges::all_of(high, [](double x) { return x == 1; });
}

UnitBox UnitBox::grown(double factor) const {
    UnitBox box = *this;
    for (std::size_t d = 0; d < low.size(); ++d) {
        const double more = (factor - 1) / 2 * (high[d] - low[d]);
        box.low[d] = std::max(0.0, low[d] - more);
        box.high[d] = std::min(1.0, high[d] + more);
    }
    return box;
}

bool surround(const std::vector<double>& points, const UnitBox& box) {
    const std::size_t dimensions = box.low.size();
    const double count = double(points.size() / dimensions);
    const double gap = 2 / std::pow(std::max(1.0, count), 1 / double(dimensions));  // of the width
    for (std::size_t d = 0; d < dimensions; ++d) {
        double low = 1, high = 0;
        for (std::size_t n = d; n < points.size(); n += dimensions) {
            low = std::min(low, points[n]);
            high = std::max(high, points[n]);
        }
        const double width = box.high[d] - box.low[d];
        const double below = box.low[d] > 0 ? 0 : gap * width, above = box.high[d] < 1 ? 0 : gap * width;
        if (low > box.low[d] + below || high < box.high[d] - above) return false;
    }
    return true;
}

}  // namespace nephos
