// SPDX-License-Identifier: Apache-2.0

// The reader of NetCDF classic files.

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

#include "study/netcdf_file.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "scenes/format/text.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// Types of values that are asked for by name.
constexpr std::uint32_t kCharacters = 2, kFloats = 5, kDoubles = 6;

// Values of an attribute: in memory they take up to 8 bytes for each of the file.
constexpr std::uint64_t kMostOfAttribute = 10'000;
constexpr std::uint64_t kMostDimensions = 1024;  // of a variable, as of libnetcdf
constexpr std::size_t kMostListed = 20;          // names of variables in a message

// A cursor over a file's bytes, big-endian.
class Reader {
  public:
    Reader(const std::filesystem::path& path, std::string bytes) : path_(path), bytes_(std::move(bytes)) {
        if (bytes_.starts_with("\x89HDF"))
            throw Error(ErrorCode::io, path_.string() +
                                           ": is a NetCDF-4 (HDF5) file: expected a classic one, which "
                                           "`nccopy -k 64-bit-offset IN OUT` makes of it");
        if (bytes_.size() < 4 || !bytes_.starts_with("CDF") ||
            (bytes_[3] != 1 && bytes_[3] != 2 && bytes_[3] != 5))
            throw Error(ErrorCode::io, path_.string() + ": is not a NetCDF classic file");
        version_ = bytes_[3];
        at_ = 4;
    }
    template <typename T>
    T get(std::uint64_t at) const {
        if (at > bytes_.size() || bytes_.size() - at < sizeof(T))
            throw Error(ErrorCode::io, path_.string() + ": ends early");
        char raw[sizeof(T)];
        std::memcpy(raw, bytes_.data() + at, sizeof(T));
        std::reverse(std::begin(raw), std::end(raw));
        T value;
        std::memcpy(&value, raw, sizeof(T));
        return value;
    }
    template <typename T>
    T next() {
        const T value = get<T>(at_);
        at_ += sizeof(T);
        return value;
    }
    std::uint64_t count() { return version_ == 5 ? next<std::uint64_t>() : next<std::uint32_t>(); }
    std::uint64_t offset() { return version_ == 1 ? next<std::uint32_t>() : next<std::uint64_t>(); }
    std::string name() {
        const std::uint64_t size = count();
        if (size > bytes_.size() - at_) throw Error(ErrorCode::io, path_.string() + ": ends early");
        const std::string text = bytes_.substr(at_, size);
        skip(size);
        return text;
    }
    void skip(std::uint64_t bytes) {
        const std::uint64_t padded = (bytes + 3) / 4 * 4;
        if (bytes > bytes_.size() || padded > bytes_.size() - at_)
            throw Error(ErrorCode::io, path_.string() + ": ends early");
        at_ += padded;
    }
    std::uint64_t size() const { return bytes_.size(); }
    std::uint64_t at() const { return at_; }
    void go_to(std::uint64_t at) { at_ = at; }

  private:
    std::filesystem::path path_;
    std::string bytes_;
    int version_ = 1;
    std::uint64_t at_ = 0;
};

std::uint64_t size_of_type(std::uint32_t type, const std::filesystem::path& path) {
    constexpr std::uint64_t kSizes[] = {0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};
    if (type < 1 || type > 11)
        throw Error(ErrorCode::io, path.string() + ": has a type of values that is not known");
    return kSizes[type];
}

double value_at(const Reader& reader, std::uint64_t at, std::uint32_t type) {
    switch (type) {
        case 1:
            return reader.get<std::int8_t>(at);
        case 2:
        case 7:
            return reader.get<std::uint8_t>(at);
        case 3:
            return reader.get<std::int16_t>(at);
        case 4:
            return reader.get<std::int32_t>(at);
        case 5:
            return double(reader.get<float>(at));
        case 6:
            return reader.get<double>(at);
        case 8:
            return reader.get<std::uint16_t>(at);
        case 9:
            return reader.get<std::uint32_t>(at);
        case 10:
            return double(reader.get<std::int64_t>(at));
        default:
            return double(reader.get<std::uint64_t>(at));
    }
}

// The values of an attribute as numbers, or its text: the first kMostOfAttribute.
struct Attribute {
    std::uint32_t type = 0;
    std::vector<double> values;
    std::string text;
    std::uint64_t count = 0;  // of all
};
using Attributes = std::map<std::string, Attribute>;

// Calls `read` with the name, the type and the number of values of each attribute of a list, and with their first byte.
template <class Read>
void for_each_attribute(Reader& reader, const std::filesystem::path& path, const Read& read) {
    reader.next<std::uint32_t>();
    for (std::uint64_t left = reader.count(); left > 0; --left) {
        const std::string name = reader.name();
        const auto type = reader.next<std::uint32_t>();
        const std::uint64_t count = reader.count(), bytes = size_of_type(type, path);
        if (count > reader.size()) throw Error(ErrorCode::io, path.string() + ": ends early");
        const std::uint64_t begin = reader.at();
        reader.skip(count * bytes);
        read(name, type, count, begin);
    }
}

void skip_attributes(Reader& reader, const std::filesystem::path& path) {
    for_each_attribute(reader, path, [](const auto&...) {});
}

// The attributes that are asked for, of the list at a place of the file.
Attributes attributes_at(Reader& reader, std::uint64_t at, const std::filesystem::path& path) {
    constexpr std::string_view kNames[] = {"_FillValue", "_Unsigned",     "missing_value", "valid_min",
                                           "valid_max",  "valid_range",   "scale_factor",  "add_offset",
                                           "axis",       "standard_name", "units",         "positive"};
    Attributes attributes;
    reader.go_to(at);
    for_each_attribute(
        reader, path,
        [&](const std::string& name, std::uint32_t type, std::uint64_t count, std::uint64_t begin) {
            if (std::ranges::count(kNames, name) == 0) return;
            Attribute attribute{type, {}, {}, count};
            const std::uint64_t bytes = size_of_type(type, path);
            for (std::uint64_t n = 0; n < std::min(count, kMostOfAttribute); ++n) {
                if (type == kCharacters)
                    attribute.text.push_back(char(reader.get<std::uint8_t>(begin + n)));
                else
                    attribute.values.push_back(value_at(reader, begin + n * bytes, type));
            }
            attributes[name] = std::move(attribute);
        });
    return attributes;
}

// The type of the same bits without a sign; of others the type itself.
std::uint32_t unsigned_type(std::uint32_t type) {
    switch (type) {
        case 1:
            return 7;
        case 3:
            return 8;
        case 4:
            return 9;
        case 10:
            return 11;
        default:
            return type;
    }
}

// The number of the bits of a whole number, read without its sign.
double without_sign(double value, std::uint32_t type) {
    const double bits = type == 1 ? 8 : type == 3 ? 16 : type == 4 ? 32 : 64;
    return value < 0 ? value + std::exp2(bits) : value;
}

struct FoundVariable {
    std::string name;
    std::vector<std::uint64_t> dimensions;
    std::uint32_t type = 0;
    std::uint64_t begin = 0;
    std::uint64_t attributes_at = 0;  // byte of the file
    Attributes attributes;            // of the one that is read
};

// The value that libnetcdf puts where nothing was written; types of one byte have none.
std::optional<double> default_fill(std::uint32_t type) {
    switch (type) {
        case 3:
            return -32767;
        case 4:
            return -2147483647;
        case kFloats:
        case kDoubles:
            return 9.9692099683868690e+36;
        case 8:
            return 65535;
        case 9:
            return 4294967295;
        case 10:
            return -9223372036854775806.0;
        case 11:
            return 18446744073709551614.0;
        default:
            return {};
    }
}

// NetCDF classic has no unsigned types but in CDF-5: the attribute _Unsigned says that a variable is meant so, and with it those
// of its attributes of the same type that are values of it (NetCDF Users Guide, "Attribute Conventions").
void take_as_unsigned(FoundVariable& variable) {
    const auto found = variable.attributes.find("_Unsigned");
    if (found == variable.attributes.end()) return;
    std::string text = found->second.text;
    while (!text.empty() && text.back() == '\0') text.pop_back();
    std::ranges::transform(text, text.begin(),
                           [](char c) { return char(std::tolower(static_cast<unsigned char>(c))); });
    const std::uint32_t type = variable.type;
    if (text != "true" || unsigned_type(type) == type) return;
    variable.type = unsigned_type(type);
    if (variable.attributes.find("_FillValue") == variable.attributes.end())
        if (const std::optional<double> usual = default_fill(type))
            variable.attributes["_FillValue"] = {type, {*usual}, {}, 1};
    // Those that hold packed values; what packs them, scale_factor and add_offset, has a sign of its own.
    for (const char* name : {"_FillValue", "missing_value", "valid_min", "valid_max", "valid_range"}) {
        const auto at = variable.attributes.find(name);
        if (at == variable.attributes.end() || at->second.type != type) continue;
        Attribute& attribute = at->second;
        attribute.type = variable.type;
        for (double& value : attribute.values) value = without_sign(value, type);
    }
}

// What the attributes of a variable say of its values (NetCDF Users Guide, "Attribute Conventions"): which are missing, and
// how the others were packed into small whole numbers: value = packed scale_factor + add_offset.
class Packing {
  public:
    Packing(const FoundVariable& variable, const std::filesystem::path& path)
        : variable_(variable), path_(path) {
        if (const Attribute* fill = find("_FillValue", 1)) {
            missing_.push_back(fill->values.front());
        } else if (const std::optional<double> usual = default_fill(variable.type)) {
            missing_.push_back(*usual);
        }
        if (const Attribute* missing = find("missing_value", 0)) add_missing(*missing);
        // As the variable holds them.
        if (variable.type == kFloats)
            for (double& value : missing_) value = double(float(value));
        std::erase_if(missing_, [](double value) { return std::isnan(value); });
        std::ranges::sort(missing_);
        missing_.erase(std::unique(missing_.begin(), missing_.end()), missing_.end());
        std::uint32_t unpacked_type = 0;
        for (const auto& [name, to] :
             {std::pair("scale_factor", &scale_), std::pair("add_offset", &offset_)}) {
            const Attribute* number = find(name, 1);
            if (number == nullptr) continue;
            *to = number->values.front();
            if (!std::isfinite(*to)) fail(name, "is not finite");
            unpacked_type = std::max(unpacked_type, number->type);
        }
        range(unpacked_type);
    }

    // NaN where the value is missing, or outside the valid range.
    double operator()(double packed) const {
        if (std::isnan(packed) || std::ranges::binary_search(missing_, packed)) return std::nan("");
        const double value = packed * scale_ + offset_, checked = range_is_unpacked_ ? value : packed;
        return checked >= low_ && checked <= high_ ? value : std::nan("");
    }

  private:
    [[noreturn]] void fail(const std::string& attribute, const std::string& message) const {
        throw Error(ErrorCode::io, fmt::format("{}: the attribute {} of the variable {} {}", path_.string(),
                                               attribute, shortened(variable_.name), message));
    }

    void add_missing(const Attribute& attribute) {
        if (attribute.count > kMostOfAttribute)
            fail("missing_value",
                 fmt::format("has {} values: expected at most {}", attribute.count, kMostOfAttribute));
        missing_.insert(missing_.end(), attribute.values.begin(), attribute.values.end());
    }

    // An attribute with that many numbers, with any number of them if `count` is 0.
    const Attribute* find(const std::string& name, std::size_t count) const {
        const auto found = variable_.attributes.find(name);
        if (found == variable_.attributes.end()) return nullptr;
        const Attribute& attribute = found->second;
        // The fill of characters is a character: it says nothing of numbers.
        if (attribute.type == kCharacters && variable_.type == kCharacters) return nullptr;
        if (attribute.type == kCharacters) fail(name, "is a text: expected a number");
        if (count > 0 && attribute.count != count)
            fail(name, fmt::format("has {} values: expected {}", attribute.count, count));
        return &attribute;
    }

    // The range is of packed values, unless it has the type of the unpacked ones and that is the wider, or is of real numbers
    // where the packed ones are whole.
    void range(std::uint32_t unpacked_type) {
        const auto is_unpacked = [&](const Attribute& attribute) {
            const auto is_real = [](std::uint32_t type) { return type == kFloats || type == kDoubles; };
            if (unpacked_type == 0) return false;
            return (is_real(attribute.type) && !is_real(variable_.type)) ||
                   (attribute.type == unpacked_type &&
                    size_of_type(unpacked_type, path_) > size_of_type(variable_.type, path_));
        };
        if (const Attribute* both = find("valid_range", 2)) {
            low_ = both->values[0];
            high_ = both->values[1];
            range_is_unpacked_ = is_unpacked(*both);
            if (!(low_ <= high_)) fail("valid_range", fmt::format("is empty: {} to {}", low_, high_));
            return;
        }
        if (const Attribute* least = find("valid_min", 1)) {
            low_ = least->values.front();
            range_is_unpacked_ = is_unpacked(*least);
        }
        if (const Attribute* most = find("valid_max", 1)) {
            high_ = most->values.front();
            range_is_unpacked_ = is_unpacked(*most);
        }
    }

    const FoundVariable& variable_;
    const std::filesystem::path& path_;
    std::vector<double> missing_;  // packed, in order, without NaN
    double scale_ = 1, offset_ = 0;
    double low_ = -std::numeric_limits<double>::infinity(), high_ = std::numeric_limits<double>::infinity();
    bool range_is_unpacked_ = false;
};

Reader opened(const std::filesystem::path& path) {
    constexpr std::size_t kLargestFile = std::size_t(1) << 32;
    std::error_code error;
    const std::uintmax_t file_bytes = std::filesystem::file_size(path, error);
    if (!error && file_bytes > kLargestFile)
        throw Error(ErrorCode::io, path.string() + ": is larger than 4 GiB");
    if (!error) require_memory(std::size_t(file_bytes), path.string());
    return {path, read_beginning(path, error ? 4096 : std::size_t(file_bytes))};
}

// Reads how many dimensions or variables follow. Throws Error(io) where they are more than memory is taken for.
std::uint64_t checked_count(Reader& reader, const char* what, const std::filesystem::path& path) {
    constexpr std::uint64_t kMost = 100'000;
    const std::uint64_t count = reader.count();
    if (count > kMost)
        throw Error(ErrorCode::io,
                    fmt::format("{}: has {} {}; at most {} can be read", path.string(), count, what, kMost));
    return count;
}

// The one of that name; without a name the only one with two dimensions or more.
const FoundVariable& variable_named(const std::vector<FoundVariable>& variables, const std::string& name,
                                    const std::filesystem::path& path) {
    const auto fail = [&](const std::string& message) {
        throw Error(ErrorCode::io, path.string() + ": " + message);
    };
    std::vector<std::string> names;  // the first of them
    std::size_t count = 0;
    const FoundVariable* found = nullptr;
    for (const FoundVariable& variable : variables) {
        const bool is_candidate = variable.dimensions.size() >= 2;
        if (is_candidate && ++count <= kMostListed) names.push_back(shortened(variable.name));
        if (name.empty() ? is_candidate && count == 1 : variable.name == name) found = &variable;
    }
    const std::string more = count > names.size() ? fmt::format(" and {} more", count - names.size()) : "";
    const std::string listed = fmt::format("{}{}", fmt::join(names, ", "), more);
    if (found == nullptr && names.empty()) fail("has no variable with two or more dimensions");
    if (found == nullptr)
        fail(fmt::format("has no variable {}; those with two or more dimensions are {}", name, listed));
    if (name.empty() && count > 1)
        fail(fmt::format("has several variables: name one with --variable (`variable` of a target) of {}",
                         listed));
    if (found->dimensions.empty())
        fail(fmt::format("the variable {} is a single number without dimensions", shortened(found->name)));
    return *found;
}

// A dimension with what its coordinate variable says. Values that lie beyond the end of the file are left out: no
// other value depends on them.
// The values of a coordinate variable follow each other, or those of the dimension of records at this distance.
NetcdfAxis axis_of(Reader& reader, const std::vector<FoundVariable>& variables, std::uint64_t dimension,
                   const NetcdfDimension& named, std::optional<std::uint64_t> distance,
                   const std::filesystem::path& path) {
    NetcdfAxis axis{named.name, named.size, {}, {}, {}, {}, {}, {}};
    const auto coordinate = std::ranges::find_if(variables, [&](const FoundVariable& variable) {
        return variable.name == named.name && variable.dimensions == std::vector{dimension};
    });
    if (coordinate == variables.end()) return axis;
    FoundVariable variable = *coordinate;
    variable.attributes = attributes_at(reader, coordinate->attributes_at, path);
    const Attributes& attributes = variable.attributes;
    for (const auto& [name, to] :
         {std::pair("axis", &axis.axis), std::pair("standard_name", &axis.standard_name),
          std::pair("units", &axis.units), std::pair("positive", &axis.positive)}) {
        const auto attribute = attributes.find(name);
        if (attribute == attributes.end()) continue;
        *to = attribute->second.text;
        while (!to->empty() && (to->back() == '\0' || to->back() == ' ')) to->pop_back();
    }
    if (named.size == 0 || variable.type == kCharacters) return axis;
    const std::uint64_t bytes = size_of_type(variable.type, path);
    std::uint64_t to_last = 0;
    if (__builtin_mul_overflow(named.size - 1, distance.value_or(bytes), &to_last) ||
        variable.begin > reader.size() || to_last > reader.size() - variable.begin ||
        bytes > reader.size() - variable.begin - to_last)
        return axis;
    take_as_unsigned(variable);
    const auto attribute = attributes.find("scale_factor");
    const double scale = attribute != attributes.end() && !attribute->second.values.empty()
                             ? attribute->second.values.front()
                             : 1;
    axis.first = scale * value_at(reader, variable.begin, variable.type);
    axis.last = scale * value_at(reader, variable.begin + to_last, variable.type);
    return axis;
}

}  // namespace

struct NetcdfSource::Variable {
    std::filesystem::path path;
    Reader reader;
    FoundVariable found;
    std::optional<Packing> packing;
    std::vector<NetcdfAxis> axes;
    bool is_record = false;
    std::uint64_t in_record = 1, record_bytes = 0;
};

NetcdfSource::~NetcdfSource() = default;
NetcdfSource::NetcdfSource(NetcdfSource&&) noexcept = default;
NetcdfSource& NetcdfSource::operator=(NetcdfSource&&) noexcept = default;

const std::string& NetcdfSource::name() const { return variable_->found.name; }
const std::vector<NetcdfAxis>& NetcdfSource::axes() const { return variable_->axes; }

NetcdfSource::NetcdfSource(const std::filesystem::path& path, const std::string& name)
    : variable_(new Variable{path, opened(path), {}, {}, {}}) {
    Reader& reader = variable_->reader;
    const std::uint64_t records = reader.count();
    std::vector<NetcdfDimension> dimensions;
    reader.next<std::uint32_t>();
    for (std::uint64_t left = checked_count(reader, "dimensions", path); left > 0; --left) {
        std::string dimension = reader.name();
        dimensions.push_back({std::move(dimension), reader.count()});
    }
    skip_attributes(reader, path);
    reader.next<std::uint32_t>();
    std::vector<FoundVariable> variables;
    std::uint64_t record_bytes = 0, record_variables = 0;
    for (std::uint64_t left = checked_count(reader, "variables", path); left > 0; --left) {
        FoundVariable& variable = variables.emplace_back();
        variable.name = reader.name();
        const std::uint64_t rank = reader.count();
        if (rank > kMostDimensions)
            throw Error(ErrorCode::io,
                        fmt::format("{}: has a variable of {} dimensions; at most {} can be read",
                                    path.string(), rank, kMostDimensions));
        for (std::uint64_t n = 0; n < rank; ++n) {
            variable.dimensions.push_back(reader.count());
            if (variable.dimensions.back() >= dimensions.size())
                throw Error(ErrorCode::io, path.string() + ": is damaged");
        }
        variable.attributes_at = reader.at();
        skip_attributes(reader, path);
        variable.type = reader.next<std::uint32_t>();
        reader.count();  // of bytes: redundant
        variable.begin = reader.offset();
        if (!variable.dimensions.empty() && dimensions[variable.dimensions[0]].size == 0) {
            // By dimensions and type: what is stated is redundant, and wrong in some files (classic format, note on vsize).
            constexpr std::uint64_t kPadding = 4;
            std::uint64_t bytes = size_of_type(variable.type, path);
            for (std::size_t n = 1; n < variable.dimensions.size(); ++n)
                if (__builtin_mul_overflow(bytes, dimensions[variable.dimensions[n]].size, &bytes))
                    throw Error(ErrorCode::io, path.string() + ": is damaged");
            record_bytes += (bytes + kPadding - 1) / kPadding * kPadding;
            ++record_variables;
        }
    }
    // Records of a file's only record variable follow each other without padding (NetCDF classic format, note on vsize).
    const auto distance_of = [&](const NetcdfDimension& dimension) {
        const bool is_apart = dimension.size == 0 && record_variables > 1;
        return is_apart ? std::optional(record_bytes) : std::nullopt;
    };
    const FoundVariable* found = &variable_named(variables, name, path);
    Variable& data = *variable_;
    std::uint64_t count = 1;
    for (std::size_t n = 0; n < found->dimensions.size(); ++n) {
        const NetcdfDimension& dimension = dimensions[found->dimensions[n]];
        const std::uint64_t size = dimension.size == 0 ? records : dimension.size;
        // Those of more dimensions are no mask, and nobody asks for their coordinates.
        constexpr std::size_t kMostOfMask = 4;  // time, z, y, x
        data.axes.push_back(found->dimensions.size() > kMostOfMask
                                ? NetcdfAxis{dimension.name, size, {}, {}, {}, {}, {}, {}}
                                : axis_of(reader, variables, found->dimensions[n], {dimension.name, size},
                                          distance_of(dimension), path));
        if (size == 0 || count > reader.size() / size)
            throw Error(ErrorCode::io, path.string() + ": is damaged or empty");
        count *= size;
        if (n > 0) data.in_record *= size;
    }
    data.is_record = dimensions[found->dimensions[0]].size == 0;
    data.found = *found;
    data.found.attributes = attributes_at(reader, found->attributes_at, path);
    // Records of a file's only record variable follow each other without padding (NetCDF classic format, note on vsize).
    data.record_bytes =
        record_variables == 1 ? data.in_record * size_of_type(data.found.type, path) : record_bytes;
    take_as_unsigned(data.found);
    data.packing.emplace(data.found, data.path);
}

void NetcdfSource::read(std::uint64_t first, std::span<double> values) const {
    const Variable& v = *variable_;
    const std::uint64_t bytes = size_of_type(v.found.type, v.path);
    for (std::size_t n = 0; n < values.size(); ++n) {
        const std::uint64_t place = first + n;
        const std::uint64_t at =
            v.is_record ? v.found.begin + place / v.in_record * v.record_bytes + place % v.in_record * bytes
                        : v.found.begin + place * bytes;
        values[n] = (*v.packing)(value_at(v.reader, at, v.found.type));
    }
}

NetcdfData read_netcdf(const std::filesystem::path& path, const std::string& name) {
    const NetcdfSource source(path, name);
    NetcdfData data;
    std::uint64_t count = 1;
    for (const NetcdfAxis& axis : source.axes()) {
        count *= axis.size;
        data.dimensions.push_back(axis.name);
        data.sizes.push_back(axis.size);
    }
    require_memory(std::size_t(count) * sizeof(double), path.string() + ": its values");
    data.values.resize(count);
    source.read(0, data.values);
    return data;
}

}  // namespace nephos
