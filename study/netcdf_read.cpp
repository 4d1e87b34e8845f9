// SPDX-License-Identifier: Apache-2.0

// The reader of NetCDF classic files.

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <string_view>

#include "study/netcdf_file.h"
#include "study/netcdf_values.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "scenes/format/text.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

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

NetcdfType next_type(Reader& reader, const std::filesystem::path& path) {
    const auto type = NetcdfType(reader.next<std::uint32_t>());
    if (!is_known(type))
        throw Error(ErrorCode::io, path.string() + ": has a type of values that is not known");
    return type;
}

double value_at(const Reader& reader, std::uint64_t at, NetcdfType type) {
    switch (type) {
        case NetcdfType::int8:
            return reader.get<std::int8_t>(at);
        case NetcdfType::text:
        case NetcdfType::uint8:
            return reader.get<std::uint8_t>(at);
        case NetcdfType::int16:
            return reader.get<std::int16_t>(at);
        case NetcdfType::int32:
            return reader.get<std::int32_t>(at);
        case NetcdfType::float32:
            return double(reader.get<float>(at));
        case NetcdfType::float64:
            return reader.get<double>(at);
        case NetcdfType::uint16:
            return reader.get<std::uint16_t>(at);
        case NetcdfType::uint32:
            return reader.get<std::uint32_t>(at);
        case NetcdfType::int64:
            return double(reader.get<std::int64_t>(at));
        case NetcdfType::uint64:
            break;
    }
    return double(reader.get<std::uint64_t>(at));
}

// Calls `read` with the name, the type and the number of values of each attribute of a list, and with their first byte.
template <class Read>
void for_each_attribute(Reader& reader, const std::filesystem::path& path, const Read& read) {
    reader.next<std::uint32_t>();
    for (std::uint64_t left = reader.count(); left > 0; --left) {
        const std::string name = reader.name();
        const NetcdfType type = next_type(reader, path);
        const std::uint64_t count = reader.count(), bytes = size_of(type);
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
std::map<std::string, NetcdfAttribute> attributes_at(Reader& reader, std::uint64_t at,
                                                     const std::filesystem::path& path) {
    constexpr std::string_view kNames[] = {"_FillValue", "_Unsigned",     "missing_value", "valid_min",
                                           "valid_max",  "valid_range",   "scale_factor",  "add_offset",
                                           "axis",       "standard_name", "units",         "positive"};
    std::map<std::string, NetcdfAttribute> attributes;
    reader.go_to(at);
    for_each_attribute(
        reader, path,
        [&](const std::string& name, NetcdfType type, std::uint64_t count, std::uint64_t begin) {
            if (std::ranges::count(kNames, name) == 0) return;
            NetcdfAttribute attribute{type, {}, {}, count};
            const std::uint64_t bytes = size_of(type);
            for (std::uint64_t n = 0; n < std::min(count, kMostOfAttribute); ++n) {
                if (type == NetcdfType::text)
                    attribute.text.push_back(char(reader.get<std::uint8_t>(begin + n)));
                else
                    attribute.values.push_back(value_at(reader, begin + n * bytes, type));
            }
            attributes[name] = std::move(attribute);
        });
    return attributes;
}

// A variable as the head of the file has it; its attributes are read of those that are asked for alone.
struct FoundVariable : PackedVariable {
    std::vector<std::uint64_t> dimensions;
    std::uint64_t begin = 0, attributes_at = 0;  // bytes of the file
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

// The lists at the beginning of a file.
struct Head {
    std::uint64_t records = 0;
    std::vector<NetcdfDimension> dimensions;  // of size 0: that of records
    std::vector<FoundVariable> variables;
    std::uint64_t record_variables = 0;
    std::uint64_t record_bytes = 0;  // of all of them, each padded

    std::uint64_t size_of_dimension(std::uint64_t n) const {
        return dimensions[n].size == 0 ? records : dimensions[n].size;
    }
    bool has_records(const FoundVariable& variable) const {
        return !variable.dimensions.empty() && dimensions[variable.dimensions[0]].size == 0;
    }
};

FoundVariable next_variable(Reader& reader, const std::vector<NetcdfDimension>& dimensions,
                            const std::filesystem::path& path) {
    FoundVariable variable;
    variable.name = reader.name();
    const std::uint64_t rank = reader.count();
    if (rank > kMostDimensions)
        throw Error(ErrorCode::io, fmt::format("{}: has a variable of {} dimensions; at most {} can be read",
                                               path.string(), rank, kMostDimensions));
    for (std::uint64_t n = 0; n < rank; ++n) {
        variable.dimensions.push_back(reader.count());
        if (variable.dimensions.back() >= dimensions.size())
            throw Error(ErrorCode::io, path.string() + ": is damaged");
    }
    variable.attributes_at = reader.at();
    skip_attributes(reader, path);
    variable.type = next_type(reader, path);
    reader.count();  // of bytes: redundant, and wrong in some files (classic format, note on vsize)
    variable.begin = reader.offset();
    return variable;
}

// Returns the bytes of a variable in a record, padded.
std::uint64_t bytes_in_record(const FoundVariable& variable, const std::vector<NetcdfDimension>& dimensions,
                              const std::filesystem::path& path) {
    constexpr std::uint64_t kPadding = 4;
    std::uint64_t bytes = size_of(variable.type);
    for (std::size_t n = 1; n < variable.dimensions.size(); ++n)
        if (__builtin_mul_overflow(bytes, dimensions[variable.dimensions[n]].size, &bytes))
            throw Error(ErrorCode::io, path.string() + ": is damaged");
    return (bytes + kPadding - 1) / kPadding * kPadding;
}

Head read_head(Reader& reader, const std::filesystem::path& path) {
    Head head;
    head.records = reader.count();
    reader.next<std::uint32_t>();
    for (std::uint64_t left = checked_count(reader, "dimensions", path); left > 0; --left) {
        std::string dimension = reader.name();
        head.dimensions.push_back({std::move(dimension), reader.count()});
    }
    skip_attributes(reader, path);
    reader.next<std::uint32_t>();
    for (std::uint64_t left = checked_count(reader, "variables", path); left > 0; --left) {
        const FoundVariable& variable =
            head.variables.emplace_back(next_variable(reader, head.dimensions, path));
        if (!head.has_records(variable)) continue;
        head.record_bytes += bytes_in_record(variable, head.dimensions, path);
        ++head.record_variables;
    }
    return head;
}

// Returns a dimension with what its coordinate variable says. Values that lie beyond the end of the file are left out: no other
// value depends on them.
NetcdfAxis axis_of(Reader& reader, const Head& head, std::uint64_t dimension,
                   const std::filesystem::path& path) {
    const NetcdfDimension named{head.dimensions[dimension].name, head.size_of_dimension(dimension)};
    NetcdfAxis axis{named.name, named.size, {}, {}, {}, {}, {}, {}};
    const auto coordinate = std::ranges::find_if(head.variables, [&](const FoundVariable& variable) {
        return variable.name == named.name && variable.dimensions == std::vector{dimension};
    });
    if (coordinate == head.variables.end()) return axis;
    FoundVariable variable = *coordinate;
    variable.attributes = attributes_at(reader, coordinate->attributes_at, path);
    const auto& attributes = variable.attributes;
    for (const auto& [name, to] :
         {std::pair("axis", &axis.axis), std::pair("standard_name", &axis.standard_name),
          std::pair("units", &axis.units), std::pair("positive", &axis.positive)}) {
        const auto attribute = attributes.find(name);
        if (attribute == attributes.end()) continue;
        *to = attribute->second.text;
        while (!to->empty() && (to->back() == '\0' || to->back() == ' ')) to->pop_back();
    }
    if (named.size == 0 || variable.type == NetcdfType::text) return axis;
    // They follow each other, or are as far apart as records.
    const std::uint64_t bytes = size_of(variable.type);
    const bool is_apart = head.has_records(variable) && head.record_variables > 1;
    std::uint64_t to_last = 0;
    if (__builtin_mul_overflow(named.size - 1, is_apart ? head.record_bytes : bytes, &to_last) ||
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
    std::optional<NetcdfPacking> packing;
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
    const Head head = read_head(reader, path);
    const FoundVariable& found = variable_named(head.variables, name, path);
    Variable& data = *variable_;
    std::uint64_t count = 1;
    for (std::size_t n = 0; n < found.dimensions.size(); ++n) {
        const std::uint64_t dimension = found.dimensions[n], size = head.size_of_dimension(dimension);
        // Those of more dimensions are no mask, and nobody asks for their coordinates.
        constexpr std::size_t kMostOfMask = 4;  // time, z, y, x
        data.axes.push_back(found.dimensions.size() > kMostOfMask
                                ? NetcdfAxis{head.dimensions[dimension].name, size, {}, {}, {}, {}, {}, {}}
                                : axis_of(reader, head, dimension, path));
        if (size == 0 || count > reader.size() / size)
            throw Error(ErrorCode::io, path.string() + ": is damaged or empty");
        count *= size;
        if (n > 0) data.in_record *= size;
    }
    data.is_record = head.has_records(found);
    data.found = found;
    data.found.attributes = attributes_at(reader, found.attributes_at, path);
    // Records of a file's only record variable follow each other without padding (NetCDF classic format, note on vsize).
    data.record_bytes = head.record_variables == 1 ? data.in_record * size_of(found.type) : head.record_bytes;
    take_as_unsigned(data.found);
    data.packing.emplace(data.found, data.path);
}

void NetcdfSource::read(std::uint64_t first, std::span<double> values) const {
    const Variable& v = *variable_;
    const std::uint64_t bytes = size_of(v.found.type);
    if (v.found.begin > v.reader.size()) throw Error(ErrorCode::io, v.path.string() + ": ends early");
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
