// SPDX-License-Identifier: Apache-2.0
// METAR and TAF: read, or refused with a caret; a METAR that was read is written as one that reads back, and both give a scene.

#include "scenes/format/reader.h"
#include "scenes/metar/metar_scene.h"
#include "scenes/metar/taf.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

template <class Layers, class Cover, class Text>
void require_scene(const Layers& layers, const Cover& cover, const Text& text) {
    std::vector<double> coverage;
    for (const auto& layer : layers) coverage.push_back(cover(layer));
    try {
        read_scene_text(text(coverage), "report");
    } catch (const Error& error) {
        fuzz::require(false, error.what());
    }
}

void check(const Metar& metar) {
    const std::string again = metar_text(metar);
    fuzz::require(metar_text(parse_metar(again)) == again, "a written report reads back");
}

void make_scene(const Metar& metar) {
    require_scene(layers_of(metar), [](const MetarLayer& layer) { return layer.cover; },
                  [&](const std::vector<double>& coverage) { return metar_scene_text(metar, {}, coverage); });
}

void make_scene(const Taf& taf) {
    require_scene(layers_of(taf), [](const TafLayer& layer) { return layer.layer.cover; },
                  [&](const std::vector<double>& coverage) { return taf_scene_text(taf, {}, coverage); });
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view text = fuzz::as_text(data, size);
    if (is_taf(text)) {
        for (const bool lenient : {false, true})
            fuzz::accepts([&] {
                const Taf taf = parse_taf(text, lenient);
                make_scene(taf);
            });
        return 0;
    }
    fuzz::accepts([&] {
        const Metar metar = parse_metar(text, true);
        make_scene(metar);
    });
    fuzz::accepts([&] { check(parse_metar(text)); });
    return 0;
}
