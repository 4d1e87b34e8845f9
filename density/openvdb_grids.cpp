// SPDX-License-Identifier: Apache-2.0
#include "density/openvdb_grids.h"

template class openvdb::tree::Tree<nephos::FloatTree::RootNodeType>;
template class openvdb::Grid<nephos::FloatTree>;
template class openvdb::tree::Tree<nephos::BoolTree::RootNodeType>;
template class openvdb::Grid<nephos::BoolTree>;
template class openvdb::tree::Tree<nephos::VectorTree::RootNodeType>;
template class openvdb::Grid<nephos::VectorTree>;
