// SPDX-License-Identifier: Apache-2.0
#include "study/netcdf_file.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>

#include <fmt/format.h>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::uint32_t kDimensionTag = 10, kVariableTag = 11, kAttributeTag = 12;
constexpr std::uint64_t kLargestVariable = 0xfffffffc;

template <typename T>
void put(std::string& out, T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    std::reverse(std::begin(bytes), std::end(bytes));  // big-endian
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

std::uint64_t size_of(NetcdfType type) {
    return type == NetcdfType::text ? 1 : type == NetcdfType::float64 ? 8 : 4;
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
    }
}

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

void skip_attributes(Reader& reader, const std::filesystem::path& path) {
    reader.next<std::uint32_t>();
    for (std::uint64_t left = reader.count(); left > 0; --left) {
        reader.name();
        const std::uint32_t type = reader.next<std::uint32_t>();
        reader.skip(reader.count() * size_of_type(type, path));
    }
}

struct FoundVariable {
    std::string name;
    std::vector<std::uint64_t> dimensions;
    std::uint32_t type = 0;
    std::uint64_t begin = 0, bytes = 0;
};

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

NetcdfData read_netcdf(const std::filesystem::path& path, const std::string& name) {
    constexpr std::size_t kLargestFile = std::size_t(1) << 32;
    std::error_code error;
    const std::uintmax_t file_bytes = std::filesystem::file_size(path, error);
    if (!error && file_bytes > kLargestFile)
        throw Error(ErrorCode::io, path.string() + ": is larger than 4 GiB");
    Reader reader(path, read_beginning(path, error ? 4096 : std::size_t(file_bytes)));
    const std::uint64_t records = reader.count();
    std::vector<NetcdfDimension> dimensions;
    reader.next<std::uint32_t>();
    for (std::uint64_t left = reader.count(); left > 0; --left) {
        std::string dimension = reader.name();
        dimensions.push_back({std::move(dimension), reader.count()});
    }
    skip_attributes(reader, path);
    reader.next<std::uint32_t>();
    std::vector<FoundVariable> variables;
    std::uint64_t record_bytes = 0, record_variables = 0;
    for (std::uint64_t left = reader.count(); left > 0; --left) {
        FoundVariable& variable = variables.emplace_back();
        variable.name = reader.name();
        for (std::uint64_t rank = reader.count(); rank > 0; --rank) {
            variable.dimensions.push_back(reader.count());
            if (variable.dimensions.back() >= dimensions.size())
                throw Error(ErrorCode::io, path.string() + ": is damaged");
        }
        skip_attributes(reader, path);
        variable.type = reader.next<std::uint32_t>();
        variable.bytes = reader.count();
        variable.begin = reader.offset();
        if (!variable.dimensions.empty() && dimensions[variable.dimensions[0]].size == 0) {
            record_bytes += variable.bytes;
            ++record_variables;
        }
    }
    std::vector<std::string> names;
    const FoundVariable* found = nullptr;
    for (const FoundVariable& variable : variables) {
        if (variable.dimensions.size() >= 2) names.push_back(variable.name);
        if (name.empty() ? variable.dimensions.size() >= 2 && names.size() == 1 : variable.name == name)
            found = &variable;
    }
    if (found == nullptr || (name.empty() && names.size() > 1))
        throw Error(
            ErrorCode::io,
            fmt::format("{}: name one of its variables with two or more dimensions, as in {}#NAME: {}",
                        path.string(), path.filename().string(), fmt::join(names, ", ")));
    if (found->dimensions.empty())
        throw Error(ErrorCode::io, fmt::format("{}: the variable {} is a single number without dimensions",
                                               path.string(), found->name));
    NetcdfData data;
    std::uint64_t count = 1, in_record = 1;
    for (std::size_t n = 0; n < found->dimensions.size(); ++n) {
        const NetcdfDimension& dimension = dimensions[found->dimensions[n]];
        const std::uint64_t size = dimension.size == 0 ? records : dimension.size;
        data.dimensions.push_back(dimension.name);
        data.sizes.push_back(size);
        if (size == 0 || count > reader.size() / size)
            throw Error(ErrorCode::io, path.string() + ": is damaged or empty");
        count *= size;
        if (n > 0) in_record *= size;
    }
    const bool is_record = dimensions[found->dimensions[0]].size == 0;
    const std::uint64_t bytes = size_of_type(found->type, path);
    // Records of a file's only record variable follow each other without padding (NetCDF classic format, note on vsize).
    if (record_variables == 1) record_bytes = in_record * bytes;
    for (std::uint64_t n = 0; n < count; ++n) {
        const std::uint64_t at = is_record
                                     ? found->begin + n / in_record * record_bytes + n % in_record * bytes
                                     : found->begin + n * bytes;
        data.values.push_back(value_at(reader, at, found->type));
    }
    return data;
}

}  // namespace nephos
