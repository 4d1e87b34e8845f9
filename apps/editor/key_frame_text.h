// SPDX-License-Identifier: Apache-2.0
#pragma once

// Key frames in the text of a scene: elements of an array whose times rise. Without window or ImGui.

#include <string>
#include <vector>

#include "scenes/format/toml_edit.h"

namespace nephos {

// A key frame as the text has it: its time, and its other keys.
struct KeyFrame {
    double time_s = 0;
    std::vector<TextEntry> entries;
};

// Returns the text with other key frames at a path ("wind", "layer[0].wind", "sun.path"); `now_there`: those
// that it has. Both rise in time. What stays of them is not touched, nor what their author wrote beside it.
// Where the text has no such elements, as their values come from elsewhere, all are added. Throws
// Error(usage) as with_value().
std::string with_key_frames(std::string text, const TextPath& path, const std::vector<KeyFrame>& now_there,
                            const std::vector<KeyFrame>& wanted);

}  // namespace nephos
