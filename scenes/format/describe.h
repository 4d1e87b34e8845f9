// SPDX-License-Identifier: Apache-2.0
#pragma once

// The description of a scene's keys for editors and for readers. Both texts are kept in the source tree
// (scenes/nephos.schema.json, docs/scene-reference.md) and compared with these functions by a test.

#include <string>

namespace nephos {

// A JSON Schema in the vocabulary of draft 4, as TOML editors read it.
std::string scene_json_schema();

// The reference of all keys in Markdown: unit, range, default, effect, source.
std::string scene_reference();

}  // namespace nephos
