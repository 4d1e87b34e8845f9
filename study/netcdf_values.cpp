// SPDX-License-Identifier: Apache-2.0
#include "study/netcdf_values.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// The type of the same bits without a sign; of others the type itself.
NetcdfType unsigned_type(NetcdfType type) {
    switch (type) {
        case NetcdfType::int8:
            return NetcdfType::uint8;
        case NetcdfType::int16:
            return NetcdfType::uint16;
        case NetcdfType::int32:
            return NetcdfType::uint32;
        case NetcdfType::int64:
            return NetcdfType::uint64;
        default:
            return type;
    }
}

// The number of the bits of a whole number, read without its sign.
double without_sign(double value, NetcdfType type) {
    return value < 0 ? value + std::exp2(8 * double(size_of(type))) : value;
}

// The value that libnetcdf puts where nothing was written; types of one byte have none.
std::optional<double> default_fill(NetcdfType type) {
    switch (type) {
        case NetcdfType::int16:
            return -32767;
        case NetcdfType::int32:
            return -2147483647;
        case NetcdfType::float32:
        case NetcdfType::float64:
            return 9.9692099683868690e+36;
        case NetcdfType::uint16:
            return 65535;
        case NetcdfType::uint32:
            return 4294967295;
        case NetcdfType::int64:
            return -9223372036854775806.0;
        case NetcdfType::uint64:
            return 18446744073709551614.0;
        default:
            return {};
    }
}

bool is_real(NetcdfType type) { return type == NetcdfType::float32 || type == NetcdfType::float64; }

[[noreturn]] void fail(const PackedVariable& variable, const std::filesystem::path& path,
                       const std::string& attribute, const std::string& message) {
    throw Error(ErrorCode::io, fmt::format("{}: the attribute {} of the variable {} {}", path.string(),
                                           attribute, shortened(variable.name), message));
}

// Returns an attribute with that many numbers, with any number of them if `count` is 0; null where there is
// none.
const NetcdfAttribute* find(const PackedVariable& variable, const std::filesystem::path& path,
                            const std::string& name, std::size_t count) {
    const auto found = variable.attributes.find(name);
    if (found == variable.attributes.end()) return nullptr;
    const NetcdfAttribute& attribute = found->second;
    // The fill of characters is a character: it says nothing of numbers.
    if (attribute.type == NetcdfType::text && variable.type == NetcdfType::text) return nullptr;
    if (attribute.type == NetcdfType::text) fail(variable, path, name, "is a text: expected a number");
    if (count > 0 && attribute.count != count)
        fail(variable, path, name, fmt::format("has {} values: expected {}", attribute.count, count));
    return &attribute;
}

// Returns the packed values that stand for none, in order.
std::vector<double> missing_values(const PackedVariable& variable, const std::filesystem::path& path) {
    std::vector<double> missing;
    if (const NetcdfAttribute* fill = find(variable, path, "_FillValue", 1)) {
        missing.push_back(fill->values.front());
    } else if (const std::optional<double> usual = default_fill(variable.type)) {
        missing.push_back(*usual);
    }
    if (const NetcdfAttribute* more = find(variable, path, "missing_value", 0)) {
        if (more->count > kMostOfAttribute)
            fail(variable, path, "missing_value",
                 fmt::format("has {} values: expected at most {}", more->count, kMostOfAttribute));
        missing.insert(missing.end(), more->values.begin(), more->values.end());
    }
    // As the variable holds them.
    if (variable.type == NetcdfType::float32)
        for (double& value : missing) value = double(float(value));
    std::erase_if(missing, [](double value) { return std::isnan(value); });
    std::ranges::sort(missing);
    missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
    return missing;
}

}  // namespace

bool is_known(NetcdfType type) { return type >= NetcdfType::int8 && type <= NetcdfType::uint64; }

std::uint64_t size_of(NetcdfType type) {
    constexpr std::uint64_t kSizes[] = {0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};
    return kSizes[std::size_t(type)];
}

void take_as_unsigned(PackedVariable& variable) {
    const auto found = variable.attributes.find("_Unsigned");
    if (found == variable.attributes.end()) return;
    std::string text = found->second.text;
    while (!text.empty() && text.back() == '\0') text.pop_back();
    std::ranges::transform(text, text.begin(),
                           [](char c) { return char(std::tolower(static_cast<unsigned char>(c))); });
    const NetcdfType type = variable.type;
    if (text != "true" || unsigned_type(type) == type) return;
    variable.type = unsigned_type(type);
    if (!variable.attributes.contains("_FillValue"))
        if (const std::optional<double> usual = default_fill(type))
            variable.attributes["_FillValue"] = {type, {*usual}, {}, 1};
    // Those that hold packed values; what packs them, scale_factor and add_offset, has a sign of its own.
    for (const char* name : {"_FillValue", "missing_value", "valid_min", "valid_max", "valid_range"}) {
        const auto at = variable.attributes.find(name);
        if (at == variable.attributes.end() || at->second.type != type) continue;
        NetcdfAttribute& attribute = at->second;
        attribute.type = variable.type;
        for (double& value : attribute.values) value = without_sign(value, type);
    }
}

NetcdfPacking::NetcdfPacking(const PackedVariable& variable, const std::filesystem::path& path)
    : missing_(missing_values(variable, path)) {
    NetcdfType unpacked_type{};
    for (const auto& [name, to] : {std::pair("scale_factor", &scale_), std::pair("add_offset", &offset_)}) {
        const NetcdfAttribute* number = find(variable, path, name, 1);
        if (number == nullptr) continue;
        *to = number->values.front();
        if (!std::isfinite(*to)) fail(variable, path, name, "is not finite");
        unpacked_type = std::max(unpacked_type, number->type);
    }
    set_range(variable, unpacked_type, path);
}

double NetcdfPacking::operator()(double packed) const {
    if (std::isnan(packed) || std::ranges::binary_search(missing_, packed)) return std::nan("");
    const double value = packed * scale_ + offset_, checked = range_is_unpacked_ ? value : packed;
    return checked >= low_ && checked <= high_ ? value : std::nan("");
}

// The range is of packed values, unless it has the type of the unpacked ones and that is the wider, or is of
// real numbers where the packed ones are whole. `unpacked_type`: of scale_factor and add_offset; none where
// there are none.
void NetcdfPacking::set_range(const PackedVariable& variable, NetcdfType unpacked_type,
                              const std::filesystem::path& path) {
    const auto is_unpacked = [&](const NetcdfAttribute& attribute) {
        if (unpacked_type == NetcdfType{}) return false;
        return (is_real(attribute.type) && !is_real(variable.type)) ||
               (attribute.type == unpacked_type && size_of(unpacked_type) > size_of(variable.type));
    };
    if (const NetcdfAttribute* both = find(variable, path, "valid_range", 2)) {
        low_ = both->values[0];
        high_ = both->values[1];
        range_is_unpacked_ = is_unpacked(*both);
        if (!(low_ <= high_))
            fail(variable, path, "valid_range", fmt::format("is empty: {} to {}", low_, high_));
        return;
    }
    if (const NetcdfAttribute* least = find(variable, path, "valid_min", 1)) {
        low_ = least->values.front();
        range_is_unpacked_ = is_unpacked(*least);
    }
    if (const NetcdfAttribute* most = find(variable, path, "valid_max", 1)) {
        high_ = most->values.front();
        range_is_unpacked_ = is_unpacked(*most);
    }
}

}  // namespace nephos
