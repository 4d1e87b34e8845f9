// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numbers as text, the same whatever the locale of the program around us is.

#include <cstddef>
#include <string>

namespace nephos {

// A number with at most so many significant digits (1..17, which read back exactly): "0.25", "1e+20", "inf".
std::string number_text(double value, int digits);

// An amount of memory, three digits or so: "12 bytes", "3.2 GiB", "300 MiB".
std::string bytes_text(std::size_t bytes);

}  // namespace nephos
