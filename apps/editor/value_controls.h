// SPDX-License-Identifier: Apache-2.0
#pragma once

// A control for the value of a key, chosen by the key's kind: sliders, numbers side by side, words, colours, names.

#include <optional>
#include <string>

#include "scenes/format/schema.h"
#include "scenes/format/toml_edit.h"

namespace nephos {

struct Editor;

// A key in the panel: its place, and its value in the text or else the default.
struct ValueRow {
    const Key& key;
    TextPath path;
    const Node* node;  // its value; null when it has none at all
    bool present;      // in the text
};

// Returns the nearest number that a key allows; of one that must be above or below its limit, a thousandth from that.
double within_limits(const Limits& limits, double number);

// Draws the control; returns the new value as TOML when the user changed it, or is about to: `unfinished` says that it is a text
// whose field has the caret yet.
std::optional<std::string> edit_value(Editor& editor, const ValueRow& row, bool& unfinished);

}  // namespace nephos
