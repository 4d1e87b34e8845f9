// SPDX-License-Identifier: Apache-2.0
#pragma once

// Keys of Scene::render, for the schema sources that describe rendering. Private to the module.

#include <string>
#include <utility>

#include "scenes/format/schema_build.h"

namespace nephos::schema_build {

// Builds a key of an option of RenderOptions; `Members` is the chain of members to it.
template <auto... Members>
Key render_key(std::string name, std::string unit, Limits limits, std::string effect,
               std::string source = {}) {
    return key<&Scene::render, Members...>(std::move(name), std::move(unit), limits, std::move(effect),
                                           std::move(source));
}

}  // namespace nephos::schema_build
