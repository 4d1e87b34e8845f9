// SPDX-License-Identifier: Apache-2.0
#pragma once

// NetCDF classic files with 64-bit offsets (CDF-2, "NetCDF Classic and 64-bit Offset File Formats", OGC 10-092r3), which
// ncdump, xarray, scipy, MATLAB, IDL and R read. Written here and not by libnetcdf, whose some thirty shared libraries would
// add more to the start of every command than a short run takes (docs/adr/0012-study-files.md).

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace nephos {

// Types of values by the numbers that files have for them; write_netcdf() takes text, int32, float32 and float64.
enum class NetcdfType : std::uint32_t {
    int8 = 1,
    text = 2,
    int16 = 3,
    int32 = 4,
    float32 = 5,
    float64 = 6,
    uint8 = 7,
    uint16 = 8,
    uint32 = 9,
    int64 = 10,
    uint64 = 11,
};

struct NetcdfDimension {
    std::string name;
    std::uint64_t size = 0;
};

using NetcdfAttributes = std::vector<std::pair<std::string, std::string>>;

struct NetcdfVariable {
    std::string name;
    NetcdfType type = NetcdfType::float32;
    std::vector<std::size_t> dimensions;  // places in the file's list; the last runs fastest
    NetcdfAttributes attributes;
    // Hands over the values in order with any number of calls of `put`; missing ones are NaN (or INT32_MIN + 1 in
    // attributes' _FillValue). Text: characters one after the other, as numbers.
    std::function<void(const std::function<void(double)>& put)> values;
};

// Writes a file atomically; its bytes are a function of the arguments alone. Throws Error(io), Error(usage) when a
// variable takes 4 GiB or more, which the format does not hold, or hands over another number of values than its
// dimensions have.
void write_netcdf(const std::filesystem::path& path, const std::vector<NetcdfDimension>& dimensions,
                  const NetcdfAttributes& attributes, const std::vector<NetcdfVariable>& variables);

// A dimension of a variable, and what its coordinate variable, the one-dimensional one of the same name, says of it (CF
// conventions); texts are empty where there is none or it does not say.
struct NetcdfAxis {
    std::string name;
    std::uint64_t size = 0;
    std::string axis, standard_name, units, positive;
    std::optional<double> first, last;  // its first and last value; not of records
};

// A variable of a file of others, CDF-1, CDF-2 or CDF-5, whose values are taken a piece at a time: as doubles they are up to
// eight times the file.
class NetcdfSource {
  public:
    // `name`, or the only variable with two or more dimensions where it is empty. Throws Error(io) that says what the file is
    // instead (a NetCDF-4 file: `nccopy -k classic` converts it), or which variables it has, or which of the attributes below
    // has no sense; Error(usage) when it does not fit into memory.
    NetcdfSource(const std::filesystem::path& path, const std::string& name);
    ~NetcdfSource();
    NetcdfSource(NetcdfSource&&) noexcept;
    NetcdfSource& operator=(NetcdfSource&&) noexcept;

    const std::string& name() const;
    const std::vector<NetcdfAxis>& axes() const;
    // Takes the values from place `first` on, the last dimension fastest. Unpacked: times scale_factor plus add_offset. NaN:
    // missing, that is _FillValue (or the usual one of the type where the file names none), one of missing_value, or outside
    // valid_range, valid_min or valid_max. Whole numbers whose attribute _Unsigned is "true" are unsigned, and so are fill and
    // range of their type. Precondition: there are so many. Throws Error(io) when the file ends before them.
    void read(std::uint64_t first, std::span<double> values) const;

  private:
    struct Variable;
    std::unique_ptr<Variable> variable_;
};

// All values of a variable.
struct NetcdfData {
    std::vector<std::string> dimensions;
    std::vector<std::uint64_t> sizes;
    std::vector<double> values;
};

// Reads one variable as a whole. Throws as NetcdfSource.
NetcdfData read_netcdf(const std::filesystem::path& path, const std::string& name);

}  // namespace nephos
