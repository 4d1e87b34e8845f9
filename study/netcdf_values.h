// SPDX-License-Identifier: Apache-2.0
#pragma once

// Values of NetCDF classic files as numbers: their types, and what the attributes of a variable say of them
// (NetCDF Users Guide, "Attribute Conventions"). Functions and const objects are safe to call from several
// threads.

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "study/netcdf_file.h"

namespace nephos {

bool is_known(NetcdfType type);  // the types of a file are numbers that may be any
// Returns the bytes that a value of a known type takes in a file.
std::uint64_t size_of(NetcdfType type);

// The values of an attribute as numbers, or its text: the first kMostOfAttribute, as in memory they take up
// to 8 bytes for each of the file.
struct NetcdfAttribute {
    NetcdfType type{};
    std::vector<double> values;
    std::string text;
    std::uint64_t count = 0;  // of all
};
inline constexpr std::uint64_t kMostOfAttribute = 10'000;

// Describes how a file holds the values of a variable.
struct PackedVariable {
    std::string name;
    NetcdfType type{};
    std::map<std::string, NetcdfAttribute> attributes;
};

// NetCDF classic has no unsigned types but in CDF-5: the attribute _Unsigned says that a variable is meant
// so, and with it those of its attributes of the same type that are values of it. Changes their types and
// values.
void take_as_unsigned(PackedVariable& variable);

// Which values of a variable are missing, and how the others were packed into small whole numbers:
// value = packed scale_factor + add_offset.
class NetcdfPacking {
  public:
    // `path`: for messages. Throws Error(io) naming an attribute that has no sense.
    NetcdfPacking(const PackedVariable& variable, const std::filesystem::path& path);

    // Returns the value; NaN where it is missing, or outside the valid range.
    double operator()(double packed) const;

  private:
    void set_range(const PackedVariable& variable, NetcdfType unpacked_type,
                   const std::filesystem::path& path);

    std::vector<double> missing_;  // packed, in order, without NaN
    double scale_ = 1, offset_ = 0;
    double low_ = -std::numeric_limits<double>::infinity(), high_ = std::numeric_limits<double>::infinity();
    bool range_is_unpacked_ = false;
};

}  // namespace nephos
