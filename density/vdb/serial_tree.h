// SPDX-License-Identifier: Apache-2.0
#pragma once

// Does with one thread what OpenVDB does with trees in parallel: in a forked process the threads of oneTBB are not there, and what
// waits for a lock that one of them held at that moment waits for ever. The memory of oneTBB has such locks, too: accessors that
// a tree knows take it, those that getUnsafeAccessor() returns do not. The tests faults.ForkedReaders notice either.
// Private to density/vdb.

#include <cstdint>
#include <exception>
#include <memory>
#include <type_traits>

#include <openvdb/openvdb.h>
#include <openvdb/tools/Count.h>

#include "density/openvdb_access.h"

namespace nephos {

// Returns the same grid, whose nodes one thread frees once nobody has it any more, unless another grid shares them: a tree frees
// its own by many. Of the types that OpenVDB registers.
template <class Grid>
std::shared_ptr<Grid> freed_serially(std::shared_ptr<Grid> grid) {
    Grid* const pointer = grid.get();
    return std::shared_ptr<Grid>(pointer, [owner = std::move(grid)](Grid*) mutable {
        openvdb::GridBase& any = *owner;
        constexpr long kAlone = 2;  // the grid, and the pointer that is asked
        try {
            if (any.baseTreePtr().use_count() == kAlone)
                any.apply<openvdb::GridTypes>([](auto& typed) { typed.tree().root().clear(); });
        } catch (const std::exception&) {  // no memory for the name of its type
        }
        owner.reset();
    });
}

template <class Tree>
std::uint64_t count_active(const Tree& tree) {
    return openvdb::tools::countActiveVoxels(tree, false);
}

// Tells trees whose voxels have no value but that they are active. Their tiles store one all the same, which says nothing.
template <typename Tree>
constexpr bool kIsActivityAlone = std::is_same_v<typename Tree::BuildType, openvdb::ValueMask>;

// A voxel of the result.
struct FloatVoxel {
    float value;
    bool is_active;
};

// Returns a tree of the same shape: `convert` makes a FloatVoxel of a value and whether it is active, which may not depend on
// where it is.
template <class Tree, class Convert>
FloatTree::Ptr float_tree(const Tree& tree, float background, const Convert& convert) {
    auto result = std::make_shared<FloatTree>(background);
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(decltype(tile)::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        const FloatVoxel voxel = convert(tile.getValue(), tile.isValueOn());
        if (voxel.is_active || voxel.value != background)
            result->addTile(tile.getLevel(), tile.getCoord(), voxel.value, voxel.is_active);
    }
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        FloatTree::LeafNodeType* to = result->touchLeaf(leaf->origin());
        for (openvdb::Index n = 0; n < FloatTree::LeafNodeType::SIZE; ++n) {
            const FloatVoxel voxel = convert(leaf->getValue(n), leaf->isValueOn(n));
            to->setValueOnly(n, voxel.value);
            to->setActiveState(n, voxel.is_active);
        }
    }
    return result;
}

}  // namespace nephos
