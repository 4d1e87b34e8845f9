// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numbers as text, independent of the locale of the program.

#include <cstddef>
#include <string>

namespace nephos {

// Formats a number with at most `digits` significant digits (1..17; 17 read back exactly): "0.25", "1e+20",
// "inf".
std::string number_text(double value, int digits);

// Returns the shortest decimal that reads back as the same double: "0.1", "40", "1e-07", "inf".
std::string number_text(double value);

// Formats an amount of memory with binary units and about three digits: "12 bytes", "3.2 GiB", "300 MiB".
std::string bytes_text(std::size_t bytes);

}  // namespace nephos
