// SPDX-License-Identifier: Apache-2.0
#pragma once

// Results as read-only NumPy arrays and dictionaries. All functions are called with the interpreter lock held, which those
// with much to do release in between.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "apps/python/live_simulation.h"

namespace nephos {

// Selects a plane of a lattice.
using Plane = BitPlane Lattice::*;

// Returns the cells of a plane, bool (nz, ny, nx).
pybind11::array cells_array(const LayerPlanes& layer, Plane plane);
// Returns the words of a plane where they are, uint64 (nz, ny, words of a row); the array keeps them alive.
pybind11::array words_array(const LayerPlanes& layer, Plane plane);
// Returns all voxels, float32 (nz, ny, nx).
pybind11::array voxels_array(const DensityGrid& grid);
// Returns the pixels, uint8 (height, width, 3).
pybind11::array pixels_array(Rgb8Image image);

// Returns the columns of statistics.csv, or of that of a layer; None where the file has no value. Throws Error(usage) when
// the scene has no layers.
pybind11::dict statistics_dict(const StepResult& result, const std::optional<std::size_t>& layer);
// Returns an array for each property of the clouds.
pybind11::dict clouds_dict(const std::vector<ConnectedCloud>& clouds, const Placement& placement,
                           bool in_space);

// Returns a Python value as the TOML of one line, as --set takes it. Throws Error(usage) for a value without such text.
std::string toml_text(const pybind11::handle& value);

}  // namespace nephos
