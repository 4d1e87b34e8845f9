// SPDX-License-Identifier: Apache-2.0
#include "render/options/shell_options.h"

#include "render/options/option_checks.h"
#include "render/shared/shared.h"

namespace nephos {

void check(const Shells& shells) {
    require(shells.count >= 1 && shells.count <= int(shader::kMaxShells), "shells.count", "1..128 shells");
    require(within(shells.spacing_m, 0.1, 1e5), "shells.spacing_m", "0.1..1e5 metres");
    require(within(shells.growth, 1, 2), "shells.growth", "1..2");
    require(reach_m(shells) <= 1e6, "shells.growth", "shells that end within 1000 km");
}

void check(const LightShafts& shafts) {
    require(within(shafts.strength, 0, 1), "light_shafts.strength", "0..1");
    require(within(shafts.g, -0.99, 0.99), "light_shafts.g", "-0.99..0.99");
    require(within(shafts.sun_share, 0, 1), "light_shafts.sun_share", "0..1");
}

void check(const Fog& fog) {
    require(within(fog.extinction_per_m, 0, 10), "fog.extinction_per_m", "0..10 per metre");
    require(within(fog.base_m, -1e5, 1e5), "fog.base_m", "-1e5..1e5 metres");
    require(within(fog.height_m, 0.1, 1e5), "fog.height_m", "0.1..1e5 metres");
    require(within(fog.patchiness, 0, 1), "fog.patchiness", "0..1");
    require(within(fog.patch_m, 1, 1e6), "fog.patch_m", "1..1e6 metres");
    const Vec3& v = fog.velocity_m_per_s;
    require(within({v.x, v.y, v.z}, -1e3, 1e3), "fog.velocity_m_per_s",
            "three numbers, -1000..1000 metres per second");
}

}  // namespace nephos
