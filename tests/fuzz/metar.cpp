// SPDX-License-Identifier: Apache-2.0
// METAR and TAF: read, or refused with a caret; a report that was read is written as one that reads back, and gives a scene.

#include "scenes/format/reader.h"
#include "scenes/metar/metar_scene.h"
#include "scenes/metar/taf.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    const std::string_view text = fuzz::as_text(data, size);
    if (is_taf(text)) {
        for (const bool lenient : {false, true}) fuzz::accepts([&] { parse_taf(text, lenient); });
        return 0;
    }
    fuzz::accepts([&] { parse_metar(text, true); });
    fuzz::accepts([&] {
        const Metar metar = parse_metar(text);
        const std::string again = metar_text(metar);
        fuzz::require(metar_text(parse_metar(again)) == again, "a written report reads back");
    });
    return 0;
}
