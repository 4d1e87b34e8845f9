// SPDX-License-Identifier: Apache-2.0
// Bindings of the passes that make orders and lists (device_lists.h). No pass depends on the size of subgroups, and no
// work group waits for another.

layout(set = 0, binding = 0) uniform OrderFrameBlock {
    OrderFrame frame;
};
layout(set = 0, binding = 1, std430) buffer Counts {
    OrderCounts counts;
};
layout(set = 0, binding = 2, std430) buffer Cloud {
    CloudBall cloud[];
};
layout(set = 0, binding = 3, std430) readonly buffer Flash {
    uint flash_fraction[];  // of the lightning, 0..65535
};
layout(set = 0, binding = 4, std430) writeonly buffer Balls {
    ViewBall balls[];
};
layout(set = 0, binding = 5, std430) readonly buffer KeysFrom {
    uint keys_from[];
};
layout(set = 0, binding = 6, std430) readonly buffer ValuesFrom {
    uint values_from[];
};
layout(set = 0, binding = 7, std430) writeonly buffer KeysTo {
    uint keys_to[];
};
layout(set = 0, binding = 8, std430) writeonly buffer ValuesTo {
    uint values_to[];
};
layout(set = 0, binding = 9, std430) buffer Table {
    uint table[];
};
layout(set = 0, binding = 10, std430) buffer Sums {
    uint sums[];  // of the table's blocks
};
layout(set = 0, binding = 11, std430) buffer Boxes {
    uvec2 boxes[];  // tiles that a splat touches, half-open: x | y << 16 of the first and of the end
};
layout(set = 0, binding = 12, std430) writeonly buffer Ranges {
    TileRange ranges[];
};
layout(set = 0, binding = 13, std430) writeonly buffer Parts {
    ViewPart parts[];
};
layout(set = 0, binding = 14) uniform ShellsBlock {
    Shells shells;
};
layout(set = 0, binding = 15, std430) readonly buffer Billboards {
    SeenBillboard billboards[];  // nearest first
};
layout(push_constant) uniform Step {
    OrderStep step;
};

uint work_group() { return gl_WorkGroupID.y * kGroupRow + gl_WorkGroupID.x; }

// Elements that are sorted, and numbers in the table.
uint sorted_elements() { return step.table == kListDigits ? counts.entries : counts.visible; }
uint table_size() {
    if (step.table == kAllSplats) return step.count + step.billboards;
    if (step.table == kSeenSplats) return counts.visible;
    if (step.table == kMapTiles) return step.tiles;
    return kSortGroup * groups_of(sorted_elements(), kSortBlock);
}
