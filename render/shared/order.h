// SPDX-License-Identifier: Apache-2.0
// Structs and constants shared by C++ and the shaders that sort splats by view and make the lists of the
// tiles on the device (device_lists.h): culling, sort by distance, screen-space boxes, (tile, splat) pairs,
// sort by tile.
#ifndef NEPHOS_RENDER_SHADERS_ORDER_H
#define NEPHOS_RENDER_SHADERS_ORDER_H

#include "render/shared/shared.h"

#ifdef __cplusplus
namespace nephos::shader {
#endif

NEPHOS_CONST uint kSortGroup = 256u;      // invocations of a work group, and values of a digit
NEPHOS_CONST uint kSortBlock = 2048u;     // elements that a work group sorts or sums
NEPHOS_CONST uint kCulled = 0xffffffffu;  // key of culled splats; no distance has these bits
NEPHOS_CONST float kFarthest_m = 1.0e15f;  // coordinates of what is drawn: squares and their sums are floats
NEPHOS_CONST float kCullReach = 1.5f;     // largest extent of a metaball in radii, as in view_sorting.cpp

// The content of a table of numbers, which determines its size.
NEPHOS_CONST uint kAllSplats = 0u;   // OrderStep::count + billboards
NEPHOS_CONST uint kSeenSplats = 1u;  // OrderCounts::visible
NEPHOS_CONST uint kSeenDigits = 2u;  // digits of their keys, for each block
NEPHOS_CONST uint kListDigits = 3u;  // digits of the entries' keys, for each block
NEPHOS_CONST uint kNeverSplattedBall = 2u;  // a value of CloudBall::detailed
NEPHOS_CONST uint kMapTiles = 4u;    // items of work in the tiles of the shadow map: OrderStep::tiles

// A metaball in device memory; 32 bytes.
struct CloudBall {
    float x, y, z;      // world, metres
    float radius;       // metres
    float depth_scale;  // as in ViewBall, and the next two
    float sun_depth;
    float height;
    uint detailed;  // PreparedCloud::detailed
};

// One of T's billboards as the camera sees it; 36 bytes.
struct SeenBillboard {
    ViewBillboard billboard;
    float distance;  // of its centre from the eye, metres
};

// The camera of a frame. Positions are sums of two floats, high and low, so that differences of positions
// have the full precision of floats anywhere in the world.
struct OrderFrame {
    vec4 eye_high;   // xyz: the eye, world; w: height of the ground
    vec4 eye_low;    // the rounding error of eye_high
    vec4 inward[5];  // xyz: normals of the planes of Frustum
    vec4 right;      // xyz: unit; w: pixels per unit of a tangent across
    vec4 up;         // xyz: unit; w: ... upwards
    vec4 forward;    // xyz: unit; w: pixels per unit at distance 1
    vec4 middle;     // xy: of the picture, pixels; z: 1 = the eye is above the ground; w: 1 = lightning
    vec4 march;      // x: 1 = rays march through clouds with detail
};

// The shadow map, for sorting by distance from the sun.
struct SunFrame {
    vec4 corner_high;  // xyz: of texel (0, 0), world
    vec4 corner_low;   // the rounding error of corner_high
    vec4 direction;    // xyz: unit; of the light's travel
    vec4 u, v;         // xyz: from metres to texels along the map's axes; w: metres a texel
};

// Push constants.
struct OrderStep {
    uint count;           // metaballs of the cloud
    uint billboards;      // splats behind the metaballs: their indices go on from `count`
    uint begin, end;      // batch: the splats of the order that are binned
    uint table;           // kAllBalls ...
    uint shift;           // of the digit in the key
    uint x, y;            // corner of the tile of the picture, pixels
    uint width, height;   // of it, pixels
    uint columns, tiles;  // tiles of pixels in it: in a row, in all
    uint capacity;        // entries that the lists have room for
    uint shells;
    uint per_item;  // centres in an item of work
};

// Push constants of the light of the shade map.
struct ShadeStep {
    uint columns;      // of the shade map, and rows
    uint shadow_size;  // of the shadow map, texels
    uint texels;       // of the shadow map along an edge of a texel of the shade map
};

// VkDispatchIndirectCommand
struct Groups {
    uint x, y, z;
};

// Counters in device memory, for indirect dispatch.
struct OrderCounts {
    uint visible;     // splats
    uint entries;     // of the lists; 0 on overflow
    uint required;    // entries of the longest batch so far, even on overflow; at most 2^32 - 1
    uint not_fitted;  // 1 = there are billboards, or metaballs that are not fitted
    uint total;       // of the last table that was summed
    Groups visible_each, visible_blocks,
        visible_digits;  // work groups: of an element each, of blocks, of the
    Groups entries_each, entries_blocks, entries_digits;  // blocks of the table of their digits
    Groups splats;                                        // of kComputeGroup
    Groups items;                                         // of LightItem
};

// The splats of a batch between two shells of air, and the shells behind them that no splat separates.
struct ViewPart {
    Groups fitted, mixed;  // tiles, for the shader without and the one with balls that are not fitted: one of
                           // them has none
    Groups air;            // for the pixels
    uint first, end;       // splats
    uint first_shell, end_shell;
};

NEPHOS_FUNCTION uint groups_of(uint elements, uint per_group) {
    return elements / per_group + (elements % per_group > 0u ? 1u : 0u);
}
NEPHOS_FUNCTION Groups dispatch_of(uint groups) {
    Groups result;
    result.x = groups < kGroupRow ? groups : kGroupRow;
    result.y = groups_of(groups, kGroupRow);
    result.z = groups > 0u ? 1u : 0u;
    return result;
}

#ifdef __cplusplus
static_assert(sizeof(CloudBall) == 32 && sizeof(OrderFrame) == 12 * 16 && sizeof(OrderStep) == 60 && sizeof(SeenBillboard) == 36);
static_assert(sizeof(Groups) == 12 && offsetof(OrderCounts, visible_each) == 20 &&
              sizeof(OrderCounts) == 116);
static_assert(sizeof(ViewPart) == 52 && offsetof(ViewPart, first) == 36);

}  // namespace nephos::shader
#endif
#endif
