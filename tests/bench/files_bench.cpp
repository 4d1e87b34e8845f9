// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/files_bench.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include "density/export/volume.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "simulation/export/export.h"
#include "simulation/run_folder.h"
#include "simulation/verify.h"

namespace nephos::bench {
namespace {

namespace fs = std::filesystem;

// A folder for temporary files that removes itself.
struct Folder {
    fs::path path = fs::temp_directory_path() / ("nephos_files_bench_" + std::to_string(::getpid()));
    Folder() { fs::create_directories(path); }
    ~Folder() {
        std::error_code none;
        fs::remove_all(path, none);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
};

std::vector<fs::path> density_files(const fs::path& run) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(run / "density")) files.push_back(entry.path());
    std::ranges::sort(files);
    return files;
}

std::vector<LoadedDensity> read_all(const std::vector<fs::path>& files) {
    std::vector<LoadedDensity> frames;
    load_densities(files, {}, [&](std::size_t, LoadedDensity&& loaded) {
        frames.push_back(std::move(loaded));
        return true;
    });
    return frames;
}

// Returns the bytes of the files, all of them read.
std::uint64_t read_bytes(const fs::path& folder) {
    std::uint64_t bytes = 0;
    std::vector<char> buffer(std::size_t(1) << 20);
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        if (!entry.is_regular_file()) continue;
        std::ifstream stream(entry.path(), std::ios::binary);
        while (stream.read(buffer.data(), std::streamsize(buffer.size())) || stream.gcount() > 0)
            bytes += std::uint64_t(stream.gcount());
    }
    return bytes;
}

void write_all(const std::vector<LoadedDensity>& frames, const fs::path& folder) {
    for (std::size_t n = 0; n < frames.size(); ++n) {
        VdbContent content;
        content.density = &frames[n].density;
        write_vdb(frame_path(folder, "cumulus", int(n) + 1), content, frames[n].metadata.value());
    }
}

BenchRow export_row(const NamedFormat& format, const fs::path& run, const std::vector<LoadedDensity>& frames,
                    const fs::path& folder) {
    ExportOptions options;
    options.source = run;
    options.folder = folder / "export";
    options.formats = {format.format};
    std::uint64_t bytes = 0;
    const auto [ours, other] = interleave(
        3,
        [&] {
            fs::remove_all(options.folder);
            bytes = 0;
            for (const ExportedFile& file : run_export(options).files) bytes += file.digest.bytes;
        },
        [&] { write_all(frames, folder / "vdb"); });
    return {fmt::format("{} frames of cumulus.toml to {}, reading included, against writing them as VDB",
                        frames.size(), format.name),
            ours, other, "<= 1x",
            fmt::format("{} threads; {:.2f} MiB a frame",
                        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                        double(bytes) / double(frames.size()) / 1048576)};
}

BenchRow bc4_row(const DensityGrid& density) {
    const Volume v = lay_out(density, {.multiple = 4});
    std::vector<std::byte> codes;
    const double ours = interleave(
                            9, [&] { codes = encode(v, VoxelType::bc4, 1); }, [] {})
                            .first;
    const Volume back = decode(codes.data(), codes.size(), v.nx, v.ny, v.nz, VoxelType::bc4, 1);
    double squares = 0, largest = 0;
    for (std::size_t n = 0; n < v.values.size(); ++n) {
        const double error = std::abs(double(back.values[n]) - double(v.values[n]));
        squares += error * error;
        largest = std::max(largest, error);
    }
    const double rate = double(v.values.size()) / ours / 1e3;
    return {fmt::format("a frame of cumulus.toml to BC4, {} x {} x {}", v.nx, v.ny, v.nz), ours, 0,
            ">= 500 MB/s of voxels, rms <= 1/255",
            fmt::format("{:.0f} Mvoxel/s; rms {:.2f}/255, largest {:.3f}", rate,
                        255 * std::sqrt(squares / double(v.values.size())), largest)};
}

std::vector<BenchRow> verify_rows(const fs::path& run, const std::vector<fs::path>& files) {
    const auto verified = [&](bool hashes_only) {
        VerifyOptions options;
        options.hashes_only = hashes_only;
        if (!verify_run(run, options).passed()) throw std::runtime_error("the run is not what it says");
    };
    std::uint64_t bytes = 0;
    const auto [hashes, reading] = interleave(
        5, [&] { verified(true); }, [&] { bytes = read_bytes(run); });
    const auto [voxels, decoding] = interleave(
        3, [&] { verified(false); }, [&] { read_all(files); });
    return {{"verify --hashes of this run, against reading its files", hashes, reading, ">= 1 GB/s",
             fmt::format("{:.1f} MB, {:.2f} GB/s", double(bytes) / 1e6, double(bytes) / hashes / 1e6)},
            {"verify with all voxels, against reading the grids", voxels, decoding, "<= 1.5x",
             "a process reads ahead"}};
}

}  // namespace

std::vector<BenchRow> files_rows(const fs::path& source) {
    const Folder folder;
    RunSettings settings = run_settings(read_scene(source / "scenes/cumulus.toml"), "cumulus.toml");
    settings.folder = folder.path / "run";
    settings.render = false;
    const fs::path run = settings.folder;
    run_scene(std::move(settings), {});
    const std::vector<fs::path> files = density_files(run);
    const std::vector<LoadedDensity> frames = read_all(files);
    std::vector<BenchRow> rows;
    for (const NamedFormat& format : export_formats())
        rows.push_back(export_row(format, run, frames, folder.path));
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    rows.push_back(bc4_row(frames.at(frames.size() / 2).density));
    for (BenchRow& row : verify_rows(run, files)) rows.push_back(std::move(row));
    return rows;
}

}  // namespace nephos::bench
