// SPDX-License-Identifier: Apache-2.0
#include "apps/statistics_file.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include <fmt/format.h>

#include "automaton/error.h"

namespace nephos {
namespace {

std::string field(double value) { return std::isnan(value) ? std::string() : fmt::format("{}", value); }

}  // namespace

std::string statistics_row(const StepResult& result) {
    const CloudStatistics& s = result.statistics;
    return fmt::format("{},{},{},{},{},{},{},{},{},{}\n", result.step, field(result.time_s), s.hum, s.act,
                       s.cld, field(s.cover), field(s.base_m), field(s.top_m), field(s.mean_density),
                       result.hash.hex());
}

std::string read_statistics(const std::filesystem::path& path, std::uint64_t steps) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) {
        throw Error(ErrorCode::io, path.string() + ": cannot open: " + std::strerror(errno));
    }
    std::string text, line;
    bool good = bool(std::getline(stream, line)) && line + '\n' == kStatisticsHeader;
    text = kStatisticsHeader;
    for (std::uint64_t step = 0; good && step < steps; ++step) {
        good = bool(std::getline(stream, line)) && line.starts_with(fmt::format("{},", step));
        text += line + '\n';
    }
    if (!good) {
        throw Error(ErrorCode::io,
                    fmt::format("{}: does not hold the steps 0 to {} that the checkpoint goes on from",
                                path.string(), steps == 0 ? 0 : steps - 1));
    }
    return text;
}

std::string_view hash_in_row(std::string_view row) {
    while (row.ends_with('\n')) row.remove_suffix(1);
    return row.substr(row.rfind(',') + 1);
}

}  // namespace nephos
