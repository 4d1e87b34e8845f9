// SPDX-License-Identifier: Apache-2.0
#pragma once

// statistics.csv: one row a step, in the order of steps, without gaps. Numbers are written so that they read
// back exactly; a field without a value (base and top of no cloud, the mean density where no density is made) is
// empty.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>

#include "core/descriptor.h"
#include "core/digest.h"
#include "simulation/simulation.h"

namespace nephos {

inline constexpr std::string_view kStatisticsHeader =
    "step,time_s,hum,act,cld,cloud_cover,base_m,top_m,base_mean_m,top_mean_m,perimeter_m,"
    "mean_density,optical_cover,hash\n";
// Of the file that each layer has in a scene with layers.
inline constexpr std::string_view kLayerStatisticsHeader =
    "step,time_s,state,clouds,rain_areas,rain_mm_per_h,hum,act,cld,cloud_cover,base_m,top_m,base_mean_m,top_mean_m,"
    "perimeter_m,mean_density,optical_cover,hash\n";

// Returns a row with its newline.
std::string statistics_row(const StepResult& result);
std::string statistics_row(const StepResult& result, const LayerStep& layer);

// Receives a row without its newline, and the hash in it.
using StatisticsVisitor =
    std::function<void(std::uint64_t step, std::string_view row, const StateHash& hash)>;

// Calls `visit`, which may be empty, for the rows of the first `steps` steps of a file in their order, and
// gives back where the next row begins, in bytes. Throws Error(io) when the file does not begin with exactly
// these rows; the message ends with `cure`.
std::uint64_t read_statistics(const std::filesystem::path& path, std::uint64_t steps,
                              const StatisticsVisitor& visit, std::string_view header = kStatisticsHeader,
                              std::string_view cure = {});
// As that, from the beginning of a file that is open.
std::uint64_t read_statistics(std::istream& file, const std::filesystem::path& path, std::uint64_t steps,
                              const StatisticsVisitor& visit, std::string_view header = kStatisticsHeader,
                              std::string_view cure = {});

// Throws Error(io) unless the file begins with the bytes that a run had written when it saved: otherwise it was edited, or is of
// another run. The message ends with `cure`.
void require_table_of_run(const std::filesystem::path& path, const FileDigest& saved,
                          std::string_view cure = {});
void require_table_of_run(std::istream& file, const std::filesystem::path& path, const FileDigest& saved);

// The cure where the run itself is called again.
inline constexpr std::string_view kStartAnew = "; --overwrite instead of --resume starts the run anew";

// Returns true when a file begins with the header; false also when it cannot be opened. Throws ReadFailure.
bool is_statistics(const std::filesystem::path& path, std::string_view header = kStatisticsHeader);

// Returns true for a file that is empty or holds a part of the header and no more: nothing of value is in it.
// Throws as is_statistics().
bool is_begun_statistics(const std::filesystem::path& path, std::string_view header = kStatisticsHeader);

// The file while a run appends to it. It holds whole rows at any moment, except while rows are being written:
// then a power cut may leave a part of them, which resume() takes away.
class StatisticsFile {
  public:
    // Creates a file with the header alone, in the place of any other or of a link, atomically: a kill or a full disk
    // leaves none without its header. Throws Error(io).
    static StatisticsFile create(const std::filesystem::path& path,
                                 std::string_view header = kStatisticsHeader);
    // Opens the file as read_statistics() has checked it. Later rows are cut off when the first new one is written or with
    // save(): until then the manifest, which has the checksum of all of them, can be written anew. Throws Error(io).
    static StatisticsFile resume(const std::filesystem::path& path, std::uint64_t steps,
                                 const StatisticsVisitor& visit, std::string_view header = kStatisticsHeader);

    // Keeps a row for the next save(), or writes out what has gathered. Throws Error(io).
    void add(std::string_view row);
    // Flushes: when it returns, all rows are in the file and on the device. Throws Error(io), also when the file was
    // removed or replaced; the file then ends with a whole row.
    void save();
    // Cuts off what stands behind the rows. Throws Error(io).
    void cut();
    // Size and checksum of what is in the file: of all rows after save().
    FileDigest content() const { return {size_, digest_.hex()}; }

  private:
    StatisticsFile(std::filesystem::path path, Descriptor file, std::uint64_t size, Digest digest);
    void write_out();

    std::filesystem::path path_;
    Descriptor file_;
    std::uint64_t size_ = 0;  // bytes in the file
    Digest digest_;           // of these
    bool is_cut_ = false;     // nothing is behind them
    std::string gathered_;    // rows that are not in the file yet
};

}  // namespace nephos
