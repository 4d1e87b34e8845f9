// SPDX-License-Identifier: Apache-2.0
#include "simulation/version.h"

namespace nephos {

std::string version() { return NEPHOS_VERSION; }

}  // namespace nephos
