// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a scene takes from other files: velocities of the wind and probabilities of the field, for the simulation; and what
// is common to all files that a scene names.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/file_stamp.h"
#include "render/terrain/terrain.h"
#include "scenes/format/named_files.h"
#include "scenes/format/scene.h"

namespace nephos {

// For a handler of `error`: throws SceneErrors with the place of the key in the scene's text, and the error's code; `error`
// itself when the place is not known, or when it has one.
[[noreturn]] void throw_at_key(const Scene& scene, const std::string& key, const Error& error);

// Returns what `read` returns, which reads the file of this key ("model[0].textures[1]"). Every reader of such a file goes
// through here: an Error that it throws becomes that of throw_at_key().
template <class Read>
auto read_at_key(const Scene& scene, const std::string& key, Read&& read) {
    try {
        return std::forward<Read>(read)();
    } catch (const Error& error) {
        throw_at_key(scene, key, error);
    }
}

// Returns the key of file `n` of a list, which may be one text instead of an array.
std::string key_of_file(const Scene& scene, const std::string& list, std::size_t n);

// Returns the scene with the values of these files, where it has not read them yet. Throws Error(io) naming a file that
// cannot be read, Error(usage) when they do not fit into the memory; both with their place, as read_at_key().
Scene with_files(Scene scene);

// Returns a text that differs where their values differ; empty without files. `scene` as with_files() returns it.
std::string hash_of_files(const Scene& scene);

// Returns the stamps of the files of these kinds that the scene names, at this moment. Whoever reads the files more than
// once compares: all of it is of one content where no stamp has changed. Thread-safe.
FileStamps stamps_of(const Scene& scene, const std::vector<FileKind>& kinds);

// Returns make_terrain() of the scene. Throws as it does, with the place of the height map.
std::shared_ptr<const HeightMap> read_terrain(const Scene& scene);

// Throws Error(usage) when the camera lies in the ground in a frame of these numbers, for which no picture can be drawn; below level
// ground it may be. `terrain`: that of the scene; null: only heights above the ground are looked at. Thread-safe.
void require_cameras_above(const Scene& scene, const HeightMap* terrain, int first_frame, int last_frame);

// Reads every file that the scene names, also the states that it starts from and those of its pictures, and forgets what is
// in them. Throws SceneErrors with a problem for each that a run could not use, or the Error of the first whose place is not
// known. Thread-safe.
void check_files(const Scene& scene);

}  // namespace nephos
