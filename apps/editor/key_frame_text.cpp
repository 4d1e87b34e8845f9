// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/key_frame_text.h"

#include <algorithm>

#include "core/text.h"

namespace nephos {
namespace {

TextPath element(TextPath array, std::size_t index) {
    array.push_back({{}, index});
    return array;
}

// Changes the keys of a key frame from `was` to `wanted`.
std::string with_entries(std::string text, const TextPath& frame, const std::vector<TextEntry>& was,
                         const std::vector<TextEntry>& wanted) {
    const auto key_of = [&](const TextEntry& entry) {
        TextPath key = frame;
        key.push_back({entry.first, 0});
        return key;
    };
    for (const TextEntry& entry : wanted) {
        if (std::ranges::count(was, entry) > 0) continue;
        const TomlNode tree = toml_tree(text);
        const TomlNode* const node = find_node(tree, key_of(entry));
        const bool is_sections =
            node != nullptr && node->form == TomlNode::Form::sections;  // [[wind.levels]]
        text = with_value(is_sections ? without(text, key_of(entry)) : text, key_of(entry), entry.second);
    }
    for (const TextEntry& entry : was)
        if (std::ranges::count(wanted, entry.first, &TextEntry::first) == 0)
            text = without(text, key_of(entry));
    return text;
}

}  // namespace

std::string with_key_frames(std::string text, const TextPath& path, const std::vector<KeyFrame>& now_there,
                            const std::vector<KeyFrame>& wanted) {
    const TomlNode tree = toml_tree(text);
    const TomlNode* const array = find_node(tree, path);
    std::size_t old = now_there.size(), next = wanted.size();  // so many are left, of each the first
    if (array == nullptr || array->items.size() != old) {
        text = without(text, path);
        old = 0;
    }
    // Goes from the last to the first, so that the places of those before stay.
    while (old > 0 || next > 0) {
        const bool is_removed = next == 0 || (old > 0 && now_there[old - 1].time_s > wanted[next - 1].time_s);
        const bool is_new = !is_removed && (old == 0 || now_there[old - 1].time_s < wanted[next - 1].time_s);
        if (is_removed) {
            text = without(text, element(path, --old));
        } else if (is_new) {
            const KeyFrame& frame = wanted[--next];
            std::vector<TextEntry> entries{{"time_s", number_text(frame.time_s)}};
            entries.insert(entries.end(), frame.entries.begin(), frame.entries.end());
            text = with_new_element(text, path, entries, old);
        } else {
            --old, --next;
            text = with_entries(text, element(path, old), now_there[old].entries, wanted[next].entries);
        }
    }
    return text;
}

}  // namespace nephos
