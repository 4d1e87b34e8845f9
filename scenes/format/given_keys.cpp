// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/given_keys.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "scenes/format/document.h"
#include "scenes/format/named_files.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

// Returns the value of a key, which is added to the table where it is not there.
Node& value_of(Node& table, std::string_view name) {
    if (Entry* entry = table.find(name)) return entry->value;
    table.entries.push_back({std::string(name), {}, {}});
    return table.entries.back().value;
}

// Returns the node of a key such as "model[0].textures[1]"; an item of a list that is one text is that text.
Node& node_at(Node& root, std::string_view key) {
    Node* node = &root;
    while (!key.empty()) {
        const std::size_t end = std::min(key.find('.'), key.size());
        std::string_view part = key.substr(0, end);
        key.remove_prefix(std::min(end + 1, key.size()));
        const std::size_t bracket = std::min(part.find('['), part.size());
        node = &value_of(*node, part.substr(0, bracket));
        if (bracket == part.size() || node->kind != Node::Kind::array) continue;
        std::size_t index = 0;
        std::from_chars(part.data() + bracket + 1, part.data() + part.size(), index);
        node = &node->items.at(index);
    }
    return *node;
}

void set_text(Node& node, std::string text) {
    node.kind = Node::Kind::text;
    node.text = std::move(text);
}

// Integers of TOML have 63 bits; a larger seed is a text.
void set_integer(Node& node, std::uint64_t number) {
    if (number > std::uint64_t(std::numeric_limits<std::int64_t>::max()))
        return set_text(node, fmt::format("{:#x}", number));
    node.kind = Node::Kind::integer;
    node.integer = std::int64_t(number);
}

// Returns a node as TOML on one line. Recursion is bounded by the parser.
std::string one_line(const Node& node) {
    std::vector<std::string> items;
    switch (node.kind) {
        case Node::Kind::boolean:
            return node.boolean ? "true" : "false";
        case Node::Kind::integer:
            return std::to_string(node.integer);
        case Node::Kind::number:
            return toml_number(node.number);
        case Node::Kind::text:
            return toml_string(node.text);
        case Node::Kind::array:
            for (const Node& item : node.items) items.push_back(one_line(item));
            return "[" + joined(items, ", ") + "]";
        case Node::Kind::table:
            for (const Entry& entry : node.entries) items.push_back(toml_key(entry.name) + " = " + one_line(entry.value));
            return items.empty() ? "{}" : "{ " + joined(items, ", ") + " }";
        case Node::Kind::date:
            break;
    }
    throw std::logic_error("no key of a scene is a date");
}

bool is_tables(const Node& node) {
    return node.kind == Node::Kind::array && !node.items.empty() &&
           std::ranges::all_of(node.items, [](const Node& item) { return item.kind == Node::Kind::table; });
}

std::string lines_of(const Node& table) {
    std::string text;
    for (const Entry& entry : table.entries) text += toml_key(entry.name) + " = " + one_line(entry.value) + "\n";
    return text;
}

}  // namespace

std::string given_toml(const Scene& scene) {
    if (!scene.given.root) return to_toml(scene);
    Node root = *scene.given.root;
    std::erase_if(root.entries, [](const Entry& entry) { return entry.name == "models"; });
    Scene named = scene;
    for_each_file(named, [&](const std::string& key, FileKind, const std::filesystem::path& file) {
        set_text(node_at(root, key), file.generic_string());
        return file;
    });
    set_text(value_of(root, "name"), scene.name);
    set_integer(value_of(root, "seed"), scene.automaton.seed);
    set_integer(value_of(value_of(root, "time"), "steps"), scene.steps);
    if (scene.frames.video) {
        Node& video = value_of(value_of(root, "frames"), "video");
        video.kind = Node::Kind::boolean;
        video.boolean = true;
    }
    std::string keys, sections;
    for (const Entry& entry : root.entries) {
        const std::string name = toml_key(entry.name);
        if (entry.value.kind == Node::Kind::table) {
            sections += "\n[" + name + "]\n" + lines_of(entry.value);
        } else if (is_tables(entry.value)) {
            for (const Node& item : entry.value.items) sections += "\n[[" + name + "]]\n" + lines_of(item);
        } else {
            keys += name + " = " + one_line(entry.value) + "\n";
        }
    }
    return keys + sections;
}

std::string given_genus(const Scene& scene, std::size_t layer) {
    if (!scene.given.root) return {};
    const Node& root = *scene.given.root;
    const Entry* const layers = root.find("layer");
    if (layers == nullptr || layer >= layers->value.items.size()) return {};
    const Entry* const genus = layers->value.items[layer].find("genus");
    return genus == nullptr ? std::string() : genus->value.text;
}

}  // namespace nephos
