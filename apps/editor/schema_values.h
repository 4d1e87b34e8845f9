// SPDX-License-Identifier: Apache-2.0
#pragma once

// Values of a scene by the description of its keys (scenes/format/schema.h): what the text says, what a missing key
// means, what a new element starts with, and readable names. Without window or ImGui.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/schema.h"
#include "scenes/format/toml_edit.h"

namespace nephos {

// Returns "Elevation" for "elevation_deg": words, without the unit.
std::string readable_name(const Key& key);
std::string readable_name(std::string_view name);
// Returns the unit as it is written behind a number: "°" for "deg"; empty without one.
std::string unit_sign(std::string_view unit);
// Returns "Skies" for "sky", the name of an array of tables.
std::string list_name(const Key& key);
// Returns "Ellipsoid" for the elements of "ellipsoids".
std::string element_name(std::string_view key);

// Returns the node of the text's values at a path; null when it is not there.
const Node* value_node(const Node& values, const TextPath& path);

// Returns the key at a path, without indices; null when it is not of the schema.
const Key* key_at(const TextPath& path);
// Returns the section whose keys stand at a path: that of the scene for an empty one.
const Section* section_at(const TextPath& path);

// Returns the owner of the keys of a section in a scene that was read; null when it is not there. Base models that come
// from other files stand before those of the text.
const void* owner_at(const Scene& scene, const TextPath& path, std::size_t models_from_files);

// Returns the value of a key as TOML, from an owner or, without one, the default; empty when it has none.
std::string default_value(const Key& key, const void* owner);
// Reads one TOML value.
Node parsed_value(const std::string& toml);

// What a new element of an array of tables needs to be valid: its required keys. Names are unlike those that are there.
// `centre_m` is where something with a place in the world is put.
std::vector<TextEntry> new_element(const Key& tables, const Node& values, const TextPath& path,
                                   const Scene* scene, const Vec3& centre_m);

// Returns where a copy of an element stands that is put behind it, in an array whose elements rise in time or height: in the
// middle to the next. Nothing for other arrays. Throws Error(usage) where there is no room.
std::optional<TextEntry> place_of_copy(const Key& tables, const Node& array, std::size_t index);

// Returns a name that no element has: "cloud 2".
std::string unused_name(std::string_view start, const std::vector<std::string>& taken);
// Returns the number under a key of a table; 0 where there is none.
double number_in(const Node& table, std::string_view key);
// Returns the texts under `name` of all elements of an array.
std::vector<std::string> names_of(const Node* array);

// Returns the names that a new element of an array may not have: those of its elements, and of models those that the scene has
// from files; `scene`: null while the text has problems.
std::vector<std::string> taken_names(const Node& values, const TextPath& array, const Scene* scene);

// Gives an element another name, and changes what refers to it: skies, rain areas and metamorphoses to models, layers to
// skies. `elsewhere`: names of models that the scene has from files. Throws Error(usage) where the name is empty, or another element
// of the array or one from a file has it.
std::string with_new_name(std::string text, const Node& values, const TextPath& path, const std::string& name,
                          const std::vector<std::string>& elsewhere);

}  // namespace nephos
