// SPDX-License-Identifier: Apache-2.0
#include "study/measured_lattice.h"

#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "core/error.h"

namespace nephos {

std::size_t measured_lattice(const Scene& scene, const std::string& layer) {
    if (scene.layers.empty()) {
        if (layer.empty()) return 0;
        throw Error(ErrorCode::usage,
                    fmt::format("the scene has no layers, and so none named `{}`: leave out --layer", layer));
    }
    std::vector<std::string_view> names;
    std::size_t found = 0;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (!scene.layers[n].automaton || scene.layers[n].is_veil) continue;
        if (scene.layers[n].name == layer) return n;
        names.push_back(scene.layers[n].name);
        found = n;
    }
    if (names.empty())
        throw Error(ErrorCode::usage,
                    "the scene has no layer with an automaton, and so no clouds that can be measured");
    if (layer.empty() && names.size() == 1) return found;
    const std::string all = fmt::format("{}", fmt::join(names, ", "));
    throw Error(
        ErrorCode::usage,
        layer.empty()
            ? fmt::format("the scene has the layers with an automaton {}: name one of them with --layer", all)
            : fmt::format("the scene has no layer `{}` with an automaton, but {}", layer, all));
}

}  // namespace nephos
