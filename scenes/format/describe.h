// SPDX-License-Identifier: Apache-2.0
#pragma once

// Generates the descriptions of a scene's keys for editors and for readers. Both texts are part of the source
// tree (scenes/nephos.schema.json, docs/scene-reference.md); a test compares them with these functions.

#include <string>

namespace nephos {

// Returns a JSON Schema in the vocabulary of draft 4, which TOML editors read. Pure.
std::string scene_json_schema();

// Returns the reference of all keys in Markdown: unit, range, default, effect, source. Pure.
std::string scene_reference();

}  // namespace nephos
