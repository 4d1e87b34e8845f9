// SPDX-License-Identifier: Apache-2.0
// Edits of scene texts: the text itself chooses them, by its hash. An edited text is TOML like the one before.

#include <span>
#include <vector>

#include "automaton/checkpoint.h"
#include "scenes/format/document.h"
#include "scenes/format/toml_edit.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

bool is_toml(const std::string& text) {
    Document document;
    return document.parse(document.add_origin("text", text, true)).has_value();
}

// All places of a tree, in the order of the text.
void collect(const TomlNode& node, TextPath& path, std::vector<TextPath>& out) {
    if (!path.empty()) out.push_back(path);
    for (const auto& [name, value] : node.entries) {
        path.push_back({name, 0});
        collect(value, path, out);
        path.pop_back();
    }
    for (std::size_t n = 0; n < node.items.size(); ++n) {
        path.push_back({{}, n});
        collect(node.items[n], path, out);
        path.pop_back();
    }
}

std::string edited(const std::string& text, const TextPath& path, unsigned kind, std::size_t index) {
    TextPath below = path;
    below.push_back({"new key", 0});
    switch (kind % 6) {
        case 0: return with_value(text, path, "1");
        case 1: return with_value(text, below, "[1, 2]");
        case 2: return without(text, path);
        case 3: return with_new_element(text, path, std::vector<TextEntry>{{"k", "\"v\""}});
        case 4: return with_copied_element(text, path, index);
        default: return with_new_element(text, below, std::vector<TextEntry>{{"a", "1"}, {"b", "2"}});
    }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text(fuzz::as_text(data, size));
    if (!is_toml(text)) {
        toml_tree(text);  // describes what comes before the error
        return 0;
    }
    std::vector<TextPath> places;
    TextPath root;
    collect(toml_tree(text), root, places);
    if (places.empty()) places.push_back({{"first", 0}});
    const StateHash hash = hash_of_bytes(std::as_bytes(std::span(text)));
    for (int turn = 0; turn < 4; ++turn) {
        const auto choice = [&](int n) { return std::size_t((n == 0 ? hash.low : hash.high) >> (16 * turn) & 0xFFFF); };
        fuzz::accepts([&] {
            const std::string after = edited(text, places[choice(0) % places.size()], unsigned(choice(1) / 16), choice(1) % 16);
            fuzz::require(is_toml(after), "an edited text is TOML");
        });
    }
    return 0;
}
