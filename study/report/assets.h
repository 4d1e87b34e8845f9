// SPDX-License-Identifier: Apache-2.0
#pragma once

// Texts of the files beside this one that a report contains; the build makes them part of the program.

#include <string_view>

namespace nephos::report {

extern const std::string_view kPageCss, kPageJs, kPlotCss, kPlotJs, kPlotLicence;

}  // namespace nephos::report
