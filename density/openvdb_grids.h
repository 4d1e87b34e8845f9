// SPDX-License-Identifier: Apache-2.0
#pragma once

// Declares the kinds of OpenVDB grids of this module (not installed) and compiles the virtual members of each once, in
// openvdb_grids.cpp: a file that makes a grid would compile them again, which takes five times as long as the rest of it.
// <openvdb/openvdb.h>, which brings grids of points along, is for files that need more of OpenVDB.

#include <openvdb/Grid.h>
#include <openvdb/tree/Tree.h>

namespace nephos {

using FloatTree = openvdb::tree::Tree4<float, 5, 4, 3>::Type;
using BoolTree = openvdb::tree::Tree4<bool, 5, 4, 3>::Type;
using VectorTree = openvdb::tree::Tree4<openvdb::Vec3f, 5, 4, 3>::Type;

using FloatGrid = openvdb::Grid<FloatTree>;
using BoolGrid = openvdb::Grid<BoolTree>;
using VectorGrid = openvdb::Grid<VectorTree>;

}  // namespace nephos

extern template class openvdb::tree::Tree<nephos::FloatTree::RootNodeType>;
extern template class openvdb::Grid<nephos::FloatTree>;
extern template class openvdb::tree::Tree<nephos::BoolTree::RootNodeType>;
extern template class openvdb::Grid<nephos::BoolTree>;
extern template class openvdb::tree::Tree<nephos::VectorTree::RootNodeType>;
extern template class openvdb::Grid<nephos::VectorTree>;
