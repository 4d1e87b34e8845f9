// SPDX-License-Identifier: Apache-2.0
#include "seeds/billboards.h"

#include "seeds/draw.h"

namespace nephos {

std::vector<Billboard> scatter_billboards(const BaseModel& model, const Cloud& cloud,
                                          std::uint64_t scene_seed, std::uint32_t model_index,
                                          std::uint32_t number) {
    std::size_t total = 0;
    for (const SeedBox& box : cloud.boxes) total += std::size_t(box.billboards);
    std::vector<Billboard> result;
    result.reserve(total);
    for (std::uint32_t b = 0; b < cloud.boxes.size(); ++b) {
        const SeedBox& box = cloud.boxes[b];
        const Seed& seed = model.seeds[box.seed];
        for (std::uint32_t i = 0; i < std::uint32_t(box.billboards); ++i) {
            // Two counters a billboard; at most 10000 of them, so the 16-bit sub-index is enough.
            const auto place = draw_for_cloud(scene_seed, model_index, number, SeedDraw::billboard, b, 2 * i);
            const auto form =
                draw_for_cloud(scene_seed, model_index, number, SeedDraw::billboard, b, 2 * i + 1);
            const auto within = [](std::uint32_t word, double centre, double edge) {
                return centre + (unit_interval(word) - 0.5) * edge;
            };
            result.push_back({{within(place[0], box.centre_m.x, box.size_m.x),
                               within(place[1], box.centre_m.y, box.size_m.y),
                               within(place[2], box.centre_m.z, box.size_m.z)},
                              draw_in(form[0], seed.billboard_width_m),
                              draw_in(form[1], seed.billboard_height_m),
                              b,
                              seed.texture,
                              form[2]});
        }
    }
    return result;
}

}  // namespace nephos
