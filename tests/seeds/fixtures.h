// SPDX-License-Identifier: Apache-2.0
#pragma once

// What several tests of this module need: base models, options of a small sky, and an expectation of errors.

#include <bit>
#include <cstdint>
#include <span>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "seeds/sky_simulation.h"

namespace nephos::test {

// T's Cloud 3 in small: two roots on one seed.
inline BaseModel branching_model() {
    Seed seed;
    seed.size_m = {10, 10, 10};
    seed.billboards = {2, 4};
    seed.roots = {{.pitch_deg = 20,
                   .yaw_deg = 30,
                   .open_pitch_deg = 60,
                   .open_yaw_deg = 60,
                   .seeds_start = 2,
                   .seeds_end = 4,
                   .reproductions = {2, 3}},
                  {.pitch_deg = 0,
                   .yaw_deg = 210,
                   .open_pitch_deg = 40,
                   .open_yaw_deg = 90,
                   .seeds_start = 2,
                   .seeds_end = 4,
                   .reproductions = {2, 3}}};
    return {.name = "branching", .genus = Genus::Cu, .seeds = {seed}, .light_distance_m = 100};
}

inline BaseModel single_box_model(double edge_m, std::string name = "box") {
    Seed seed;
    seed.size_m = {edge_m, edge_m, edge_m};
    return {.name = std::move(name), .genus = Genus::Sc, .seeds = {seed}, .light_distance_m = 100};
}

// Two skies of single boxes: 40 clouds at state 0, 80 at state 1; a world of 10 km x 6 km.
inline SkyOptions small_sky() {
    SkyOptions o;
    o.name = "low";
    o.seed = 99;
    o.world = {-2000, 1000, 8000, 7000};
    o.models = {single_box_model(100, "fair"), single_box_model(300, "storm")};
    o.skies = {{"fair", 0, 40, {{0, 3}}}, {"storm", 1, 80, {{1, 3}}}};
    o.schedule = {{0, 0}};
    return o;
}

inline Wind constant_wind(double east, double north) {
    return {{{.time_s = 0, .levels = {{.height_m = 0, .velocity = {east, north}}}}}};
}

// FNV-1a over the bits of numbers: a fingerprint that does not depend on the platform's hash functions.
class Fingerprint {
  public:
    void add(std::uint64_t word) {
        for (int byte = 0; byte < 8; ++byte) hash_ = (hash_ ^ (word >> (8 * byte) & 0xff)) * 0x100000001b3;
    }
    void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
    void add(const Vec3& v) {
        add(v.x);
        add(v.y);
        add(v.z);
    }
    std::uint64_t value() const { return hash_; }

  private:
    std::uint64_t hash_ = 0xcbf29ce484222325;
};

template <class Action>
void expect_error(ErrorCode code, const std::string& part, Action&& action) {
    try {
        action();
        ADD_FAILURE() << "no error, expected one about \"" << part << "\"";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), code) << error.what();
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
}

}  // namespace nephos::test
