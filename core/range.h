// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nephos {

// A closed range from which a uniform number is drawn; min <= max.
struct Range {
    double min = 0, max = 0;
    bool operator==(const Range&) const = default;
};

}  // namespace nephos
