// SPDX-License-Identifier: Apache-2.0
#include "study/netcdf_file.h"

#include <bit>
#include <cstring>

#include "study/netcdf_values.h"
#include <fmt/format.h>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::uint32_t kDimensionTag = 10, kVariableTag = 11, kAttributeTag = 12;
constexpr std::uint64_t kLargestVariable = 0xfffffffc;

// Big-endian.
template <typename T>
void put(std::string& out, T value) {
    static_assert(sizeof(T) == 4 || sizeof(T) == 8);
    char bytes[sizeof(T)];
    if constexpr (sizeof(T) == 4) {
        const std::uint32_t swapped = __builtin_bswap32(std::bit_cast<std::uint32_t>(value));
        std::memcpy(bytes, &swapped, sizeof(T));
    } else {
        const std::uint64_t swapped = __builtin_bswap64(std::bit_cast<std::uint64_t>(value));
        std::memcpy(bytes, &swapped, sizeof(T));
    }
    out.append(bytes, sizeof(T));
}

void pad(std::string& out) { out.append((4 - out.size() % 4) % 4, '\0'); }

void put_name(std::string& out, const std::string& name) {
    put(out, std::uint32_t(name.size()));
    out += name;
    pad(out);
}

void put_attributes(std::string& out, const NetcdfAttributes& attributes) {
    put(out, attributes.empty() ? 0u : kAttributeTag);
    put(out, std::uint32_t(attributes.size()));
    for (const auto& [name, value] : attributes) {
        put_name(out, name);
        put(out, std::uint32_t(NetcdfType::text));
        put_name(out, value);  // its length, its characters, padding
    }
}

std::uint64_t value_count(const NetcdfVariable& variable, const std::vector<NetcdfDimension>& dimensions) {
    std::uint64_t count = 1;
    for (const std::size_t n : variable.dimensions) count *= dimensions[n].size;
    return count;
}

std::uint64_t padded_bytes(const NetcdfVariable& variable, const std::vector<NetcdfDimension>& dimensions) {
    const std::uint64_t bytes = value_count(variable, dimensions) * size_of(variable.type);
    return (bytes + 3) / 4 * 4;
}

std::string header(const std::vector<NetcdfDimension>& dimensions, const NetcdfAttributes& attributes,
                   const std::vector<NetcdfVariable>& variables, std::uint64_t first_offset) {
    std::string out = "CDF\x02";
    put(out, 0u);  // no records
    put(out, dimensions.empty() ? 0u : kDimensionTag);
    put(out, std::uint32_t(dimensions.size()));
    for (const NetcdfDimension& dimension : dimensions) {
        put_name(out, dimension.name);
        put(out, std::uint32_t(dimension.size));
    }
    put_attributes(out, attributes);
    put(out, variables.empty() ? 0u : kVariableTag);
    put(out, std::uint32_t(variables.size()));
    for (const NetcdfVariable& variable : variables) {
        put_name(out, variable.name);
        put(out, std::uint32_t(variable.dimensions.size()));
        for (const std::size_t n : variable.dimensions) put(out, std::uint32_t(n));
        put_attributes(out, variable.attributes);
        put(out, std::uint32_t(variable.type));
        put(out, std::uint32_t(padded_bytes(variable, dimensions)));
        put(out, first_offset);
        first_offset += padded_bytes(variable, dimensions);
    }
    return out;
}

void put_value(std::string& out, NetcdfType type, double value) {
    switch (type) {
        case NetcdfType::text:
            out += char(value);
            break;
        case NetcdfType::int32:
            put(out, std::int32_t(value));
            break;
        case NetcdfType::float32:
            put(out, float(value));
            break;
        case NetcdfType::float64:
            put(out, value);
            break;
        default:
            throw Error(
                ErrorCode::usage,
                fmt::format("NetCDF type {}: cannot be written: expected text, int32, float32 or float64",
                            std::uint32_t(type)));
    }
}

}  // namespace

void write_netcdf(const std::filesystem::path& path, const std::vector<NetcdfDimension>& dimensions,
                  const NetcdfAttributes& attributes, const std::vector<NetcdfVariable>& variables) {
    for (const NetcdfVariable& variable : variables) {
        if (padded_bytes(variable, dimensions) > kLargestVariable)
            throw Error(
                ErrorCode::usage,
                fmt::format(
                    "{}: the variable {} takes {} bytes: a NetCDF classic file holds 4 GiB of each; keep "
                    "fewer runs or shorter series in one sweep",
                    path.string(), variable.name, padded_bytes(variable, dimensions)));
    }
    const std::uint64_t header_size = header(dimensions, attributes, variables, 0).size();
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        append(header(dimensions, attributes, variables, header_size));
        for (const NetcdfVariable& variable : variables) {
            std::string piece;
            std::uint64_t count = 0;
            variable.values([&](double value) {
                put_value(piece, variable.type, value);
                ++count;
                if (piece.size() < (1u << 20)) return;
                append(piece);
                piece.clear();
            });
            if (count != value_count(variable, dimensions))
                throw Error(ErrorCode::usage,
                            fmt::format("the variable {} has {} values instead of {}", variable.name, count,
                                        value_count(variable, dimensions)));
            if (variable.type == NetcdfType::text) piece.append((4 - count % 4) % 4, '\0');
            append(piece);
        }
    });
}

}  // namespace nephos
