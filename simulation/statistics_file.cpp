// SPDX-License-Identifier: Apache-2.0
#include "simulation/statistics_file.h"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::size_t kGatheredBytes = std::size_t(1) << 20;

std::string field(double value) { return std::isnan(value) ? std::string() : fmt::format("{}", value); }

// What the two kinds of rows end with.
std::string fields(const CloudStatistics& s, const StateHash& hash) {
    return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}", s.hum, s.act, s.cld, field(s.cover),
                       field(s.base_m), field(s.top_m), field(s.base_mean_m), field(s.top_mean_m),
                       field(s.perimeter_m), field(s.mean_density), field(s.optical_cover), hash.hex());
}

// The hash at the end of a row.
std::optional<StateHash> hash_in(std::string_view row) {
    const std::string_view digits = row.substr(row.rfind(',') + 1);
    if (digits.size() != 32) return std::nullopt;
    StateHash hash;
    const auto number = [](std::string_view text, std::uint64_t& value) {
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
        return error == std::errc() && end == text.data() + text.size();
    };
    if (!number(digits.substr(0, 16), hash.high) || !number(digits.substr(16), hash.low)) return std::nullopt;
    return hash;
}

// Nothing for what is no file that can be opened. Throws ReadFailure.
std::optional<std::string> beginning_of(const std::filesystem::path& path, std::size_t size) {
    try {
        return read_beginning(path, size);
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error&) {
        return std::nullopt;
    }
}

void require_saved(const std::filesystem::path& path, const FileDigest& found, const FileDigest& saved,
                   std::string_view cure) {
    if (found != saved)
        throw Error(ErrorCode::io,
                    fmt::format("{}: does not begin with the {} bytes that the run had written: it was "
                                "changed, or is of another run{}",
                                path.string(), saved.bytes, cure));
}

[[noreturn]] void fail(const std::filesystem::path& path, int error) {
    throw Error(ErrorCode::io, path.string() + ": cannot write: " + std::strerror(error));
}

}  // namespace

std::string statistics_row(const StepResult& result) {
    return fmt::format("{},{},{}\n", result.step, field(result.time_s),
                       fields(result.statistics, result.hash));
}

std::string statistics_row(const StepResult& result, const LayerStep& layer) {
    return fmt::format("{},{},{},{},{},{},{}\n", result.step, field(result.time_s), field(layer.state),
                       layer.clouds, layer.rain_areas, field(layer.rain_mm_per_h),
                       fields(layer.statistics, layer.hash));
}

std::uint64_t read_statistics(const std::filesystem::path& path, std::uint64_t steps,
                              const StatisticsVisitor& visit, std::string_view header,
                              std::string_view cure) {
    std::ifstream stream = open_stream(path);
    return read_statistics(stream, path, steps, visit, header, cure);
}

std::uint64_t read_statistics(std::istream& stream, const std::filesystem::path& path, std::uint64_t steps,
                              const StatisticsVisitor& visit, std::string_view header,
                              std::string_view cure) {
    rewind(stream, path);
    std::string line;
    // A last line without its newline is one that was being written.
    const auto next_line = [&] { return std::getline(stream, line) && !stream.eof(); };
    bool good = next_line() && line + '\n' == header;
    std::uint64_t bytes = header.size();
    for (std::uint64_t step = 0; good && step < steps; ++step) {
        good = next_line() && line.starts_with(fmt::format("{},", step));
        const std::optional<StateHash> hash = good ? hash_in(line) : std::nullopt;
        good = hash.has_value();
        if (good && visit) visit(step, line, *hash);
        bytes += line.size() + 1;
    }
    if (!good) {
        check_reading(stream, path);
        throw Error(ErrorCode::io,
                    fmt::format("{}: does not hold the steps 0 to {} that the checkpoint goes on from{}",
                                path.string(), steps == 0 ? 0 : steps - 1, cure));
    }
    return bytes;
}

void require_table_of_run(const std::filesystem::path& path, const FileDigest& saved, std::string_view cure) {
    require_saved(path, file_digest(path, saved.bytes), saved, cure);
}

void require_table_of_run(std::istream& file, const std::filesystem::path& path, const FileDigest& saved) {
    require_saved(path, file_digest(file, path, saved.bytes), saved, {});
}

bool is_statistics(const std::filesystem::path& path, std::string_view header) {
    const std::optional<std::string> text = beginning_of(path, header.size());
    return text == header;
}

bool is_begun_statistics(const std::filesystem::path& path, std::string_view header) {
    const std::optional<std::string> text = beginning_of(path, header.size() + 1);
    return text && header.starts_with(*text);
}

StatisticsFile::StatisticsFile(std::filesystem::path path, Descriptor file, std::uint64_t size, Digest digest)
    : path_(std::move(path)), file_(std::move(file)), size_(size), digest_(std::move(digest)) {}

StatisticsFile StatisticsFile::create(const std::filesystem::path& path, std::string_view header) {
    std::error_code error;
    if (std::filesystem::is_symlink(path, error)) ::unlink(path.c_str());  // its target is somebody's
    write_atomically(path, header);
    Digest digest;
    digest.add(header);
    return StatisticsFile(path, open_regular_file(path, O_WRONLY | O_APPEND | O_NOFOLLOW), header.size(),
                          std::move(digest));
}

StatisticsFile StatisticsFile::resume(const std::filesystem::path& path, std::uint64_t steps,
                                      const StatisticsVisitor& visit, std::string_view header) {
    separate_from_links(path);  // a copy of the run may be made of them
    Descriptor file = open_regular_file(path, O_WRONLY | O_APPEND | O_NOFOLLOW);
    Digest digest;
    digest.add(header);
    const auto add_row = [&](std::uint64_t step, std::string_view row, const StateHash& hash) {
        digest.add(row);
        digest.add("\n");
        if (visit) visit(step, row, hash);
    };
    const std::uint64_t size = read_statistics(path, steps, add_row, header, kStartAnew);
    if (!is_same_file(file.get(), path))  // what is cut is what was read
        throw Error(ErrorCode::io, path.string() + ": was removed or replaced while it was read");
    return StatisticsFile(path, std::move(file), size, std::move(digest));
}

void StatisticsFile::add(std::string_view row) {
    gathered_ += row;
    if (gathered_.size() >= kGatheredBytes) write_out();
}

void StatisticsFile::save() {
    write_out();
    if (const int error = flush_to_device(file_.get())) fail(path_, error);
    if (!is_same_file(file_.get(), path_))
        throw Error(ErrorCode::io, path_.string() + ": was removed or replaced while the run was writing it");
}

void StatisticsFile::cut() {
    struct stat status {};
    const bool is_whole = ::fstat(file_.get(), &status) == 0 && std::uint64_t(status.st_size) == size_;
    if (!is_whole && ::ftruncate(file_.get(), off_t(size_)) != 0) fail(path_, errno);
    is_cut_ = true;
}

void StatisticsFile::write_out() {
    if (!is_cut_) cut();
    if (const int error = write_all(file_.get(), std::as_bytes(std::span(gathered_)))) {
        // Half a row may be in the file. Should taking it away fail too, resume() does it.
        [[maybe_unused]] const int ignored = ::ftruncate(file_.get(), off_t(size_));
        fail(path_, error);
    }
    size_ += gathered_.size();
    digest_.add(gathered_);
    gathered_.clear();
}

}  // namespace nephos
