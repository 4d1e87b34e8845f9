// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells a lack of threads from other failures.

#include <exception>

namespace nephos {

// Returns whether an exception, of the standard library or of TBB, says that this process could not start another
// thread, whatever that was for.
bool is_lack_of_threads(const std::exception& error);

}  // namespace nephos
