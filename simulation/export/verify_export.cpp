// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <set>
#include <span>
#include <string_view>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "density/export/bricks.h"
#include "density/export/cloud_picture.h"
#include "density/export/containers.h"
#include "simulation/export/export_list.h"
#include "simulation/memory.h"
#include "simulation/verify_problems.h"

namespace nephos {
namespace {

// Of the voxels of all files of a format to their sources.
struct Difference {
    double largest = 0, allowed = 0, squares = 0;  // the first two of any voxel
    double too_far = 0,
           instead_of = 0;  // of the voxel that differs most from what is allowed of it; 0: none by more
    std::size_t voxels = 0, cut = 0;  // cut: of the source above what their type holds
};

[[noreturn]] void bad_file(const std::filesystem::path& path, const std::string& what) {
    throw Error(ErrorCode::io, path.string() + ": " + what);
}

// Limits what a voxel may differ by: an absolute part, and one relative to its value.
struct Tolerance {
    double absolute = 0, relative = 0;
    double of(double value) const { return absolute + relative * value; }
};

// Adds the difference of a voxel.
void add(double expected, double found, double allowed, Difference& d) {
    const double difference = std::abs(expected - found);
    d.largest = std::max(d.largest, difference);
    d.allowed = std::max(d.allowed, allowed);
    if (difference - allowed > d.too_far - d.instead_of) {
        d.too_far = difference;
        d.instead_of = allowed;
    }
    d.squares += difference * difference;
}

// `allowed` gives what the voxel of an index may differ by; `most` is the greatest value that the type holds: greater ones of the
// source are it in the file.
template <typename Allowed>
void compare(const std::filesystem::path& path, const std::vector<float>& expected,
             const std::vector<float>& found, const Allowed& allowed, Difference& d,
             float most = std::numeric_limits<float>::infinity()) {
    if (expected.size() != found.size()) bad_file(path, "has another size than its source");
    for (std::size_t n = 0; n < expected.size(); ++n) {
        if (!std::isfinite(found[n])) bad_file(path, "holds a voxel that is no finite number");
        if (expected[n] > most) ++d.cut;
        add(double(std::min(expected[n], most)), double(found[n]), allowed(n), d);
    }
    d.voxels += expected.size();
}

// The least and the largest value of a block of a grid, which beyond the box has zeros.
struct Range {
    double least = 0, largest = 0;
};

// Grids of the same extent, without room for the voxels between their clouds. `allowed` gives what a voxel of a value may differ by
// in a block of a range.
template <typename Allowed>
void compare(const DensityGrid& expected, const DensityGrid& found, const Allowed& allowed, Difference& d) {
    constexpr std::size_t kWholeBlock = 512;
    expected.visit_blocks(found, [&](std::span<const float> a, std::span<const float> b) {
        const auto [least, largest] = std::ranges::minmax(a);
        const Range range{a.size() == kWholeBlock ? double(least) : 0, double(largest)};
        for (std::size_t n = 0; n < a.size(); ++n)
            add(double(a[n]), double(b[n]), allowed(double(a[n]), range), d);
    });
    d.voxels += expected.extent().cells();
}

// On the way to a code and back there are five roundings of floats.
constexpr double kRoundings = 5 * 0x1p-24;
constexpr double kSmallest = double(std::numeric_limits<float>::min());

// Codes go to `scale`. Floats are exact to their bits, and halves to their eleven, or half of their smallest step.
Tolerance tolerance_of(VoxelType type, double scale) {
    const double error = largest_error(type) * 1.0001 + kRoundings;
    if (type == VoxelType::r16f) return {0x1.0001p-25 * scale + kSmallest, error};
    if (type == VoxelType::r32f) return {0x1.0001p-150 * scale + kSmallest, error};
    return {error * scale + kSmallest, 0};
}

// Gives what each voxel of a block of BC4 may differ by: its steps go from the least to the greatest of 4 x 4 voxels of a slice, as they
// are when what is above the scale is cut.
class BlockTolerance {
  public:
    BlockTolerance(const Volume& volume, double scale) : volume_(volume), scale_(scale) {}
    double operator()(std::size_t n) const {
        const auto nx = std::size_t(volume_.nx), ny = std::size_t(volume_.ny);
        const std::size_t x = n % nx / 4 * 4, y = n / nx % ny / 4 * 4, z = n / nx / ny;
        float least = float(scale_), most = 0;
        for (std::size_t j = y; j < std::min(y + 4, ny); ++j) {
            const float* row = volume_.values.data() + (z * ny + j) * nx;
            const auto [low, high] = std::minmax_element(row + x, row + std::min(x + 4, nx));
            least = std::min(least, *low);
            most = std::max(most, *high);
        }
        const double range = std::min(double(most), scale_) - double(least);
        return (range / 14 + scale_ / 510 * (1 + 1.0 / 7)) * 1.0001 + kRoundings * scale_ + kSmallest;
    }

  private:
    const Volume& volume_;
    double scale_;
};

// Throws ReadFailure unless there is room for what a comparison takes.
void require_room(const std::filesystem::path& path, std::uint64_t bytes, const VolumeBox& box) {
    const auto& [nx, ny, nz] = box.size;
    try {
        require_memory(std::size_t(bytes),
                       fmt::format("what {} x {} x {} voxels are compared in", nx, ny, nz));
    } catch (const Error& failure) {
        throw ReadFailure(path, failure.what(), "compare with its source");
    }
}

std::uint64_t size_of_file(const std::filesystem::path& path) {
    std::error_code error;
    const std::uintmax_t bytes = std::filesystem::file_size(path, error);
    return error ? 0 : bytes;  // reading it tells
}

constexpr const char* kElsewhere = "lies at another place than its source";
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Returns whether a grid lies where it should, but for the rounding of the centre of its first voxel, which is what files hold.
bool is_at(const Placement& found, const Placement& expected) {
    const double size = expected.cell_size_m;
    if (!(std::abs(found.cell_size_m - size) <= 8 * kEpsilon * size)) return false;
    for (int a = 0; a < 3; ++a) {
        const double most = 8 * kEpsilon * (std::abs(expected.origin_m[a]) + size);
        if (!(std::abs(found.origin_m[a] - expected.origin_m[a]) <= most)) return false;
    }
    return true;
}

bool is_at(const VtiPlace& found, const VolumeBox& box) {
    for (std::size_t a = 0; a < 3; ++a) {
        const double size = box.voxel_m[a], first_m = box.min_m[a] + size / 2;
        if (!(std::abs(found.voxel_m[a] - size) <= 8 * kEpsilon * size)) return false;
        if (!(std::abs(found.first_m[a] - first_m) <= 8 * kEpsilon * (std::abs(first_m) + size)))
            return false;
    }
    return true;
}

EncodedVolume read_dense(const std::filesystem::path& path, const std::string& format, VoxelType type,
                         const VolumeBox& box, int levels, std::optional<double> time_s) {
    const auto& [nx, ny, nz] = box.size;
    // The file is read at once, and then its codes are made of it. What is compressed may have far more voxels than bytes, and
    // has them twice on the way; of the others a wrong box asks for no memory.
    const std::uint64_t of_file = size_of_file(path),
                        codes = encoded_bytes(level_sizes(box.size, levels), type);
    const bool may_be_packed = format == "vti" || format == "slices",
               is_packed = may_be_packed && of_file < codes;
    const bool is_smaller = format == "bricks" || may_be_packed;
    require_room(path, of_file + (is_packed ? 2 * codes : is_smaller ? codes : of_file), box);
    if (format == "bricks") return read_bricks(path, codes);
    if (format == "raw") return read_raw(path, type, nx, ny, nz, levels);
    if (format == "dds") return read_dds(path);
    if (format == "ktx2") return read_ktx2(path);
    if (format == "vti") {
        VtiPlace place;
        EncodedVolume volume = read_vti(path, &place);
        if (!is_at(place, box)) bad_file(path, kElsewhere);
        if (time_s && place.time_s != *time_s) bad_file(path, "is of another moment than its source");
        return volume;
    }
    return read_slices(path, nx, ny, nz, slice_columns(nx, ny, nz));
}

// Returns half a step of the codes of a leaf, a block of the grid, which go from its least to its greatest value; or all that is
// between them where the library finds infinity for its codes a unit.
double allowed_error(NanoQuantise quantise, double value, const Range& of_block) {
    if (quantise == NanoQuantise::none) return kRoundings * value + kSmallest;
    const double codes = largest_code(quantise), range = of_block.largest - of_block.least;
    const double lost = codes / double(std::numeric_limits<float>::max());
    return range * 1.005 / codes / 2 + kRoundings * of_block.largest + 1.001 * std::min(range, lost) +
           kSmallest;
}

// Adds the differences of one file to its source. Returns false for what cannot be compared.
bool compare_file(const std::filesystem::path& folder, const ListedExport& list,
                  const ListedExport::Sequence& s, const ExportedFile& file, Difference& d) {
    VdbReadOptions reading;
    reading.grid = list.grid;
    const LoadedDensity of_source = load_density(folder / file.source, reading);
    const DensityGrid& source = of_source.density;
    const std::filesystem::path path = folder / file.path;
    VolumeLayout plain;
    plain.factor = s.layout.factor;
    const VolumeBox cells = box_of(source.extent(), source.placement(), plain);
    if (file.format == "vdb" || file.format == "nvdb") {
        if (s.layout.factor > 1) require_room(path, layout_bytes(cells.voxels(), s.layout.factor), cells);
        const DensityGrid expected = coarser(source, s.layout.factor);
        Placement at = expected.placement();
        if (file.format == "nvdb") {
            const DensityGrid found = read_nanovdb(path, expected.extent());
            if (!is_at(found.placement(), at)) bad_file(path, kElsewhere);
            compare(
                expected, found,
                [&](double value, const Range& range) { return allowed_error(list.quantise, value, range); },
                d);
            return true;
        }
        const LoadedDensity loaded = load_density(path);
        // Values that a reader has to mend, such as no numbers, are not those of the source.
        if (!loaded.notes.empty()) bad_file(path, loaded.notes.front());
        const DensityGrid& found = loaded.density;
        if (list.half_voxel_shift)
            for (int a = 0; a < 3; ++a) at.origin_m[a] -= at.cell_size_m / 2;
        if (!is_at(found.placement(), at)) bad_file(path, kElsewhere);
        const auto type = list.types.find(file.format);
        if (!(found.extent() == expected.extent())) bad_file(path, "has another size than its source");
        const Tolerance t = tolerance_of(type == list.types.end() ? VoxelType::r32f : type->second, 1);
        compare(
            expected, found, [&](double value, const Range&) { return t.of(value); }, d);
        return true;
    }
    if (file.format == "flightgear") {
        require_room(
            path, largest_cloud_bytes(cells.size, s.layout.periodic, s.layout.factor, source.active_voxels()),
            cells);
        const CloudVoxels expected = largest_cloud(lay_out(source, plain), s.layout.periodic, s.scale),
                          found = read_cloud_picture(path);
        if (found.side != expected.side || found.height != expected.height)
            bad_file(path, "has another size than its source's cloud");
        compare(
            path, {expected.codes.begin(), expected.codes.end()}, {found.codes.begin(), found.codes.end()},
            [](std::size_t) { return 0.0; }, d);
        d.cut += expected.cut;
        return true;
    }
    const auto type = list.types.find(file.format);
    if (type == list.types.end()) return false;
    const VolumeBox box = box_of(source.extent(), source.placement(), s.layout);
    constexpr int kMostSide = 1 << 20;
    if (std::ranges::any_of(box.size, [](int side) { return side > kMostSide; }))
        bad_file(path, fmt::format("its list states a box of {} x {} x {} voxels", box.size[0], box.size[1],
                                   box.size[2]));
    const EncodedVolume encoded =
        read_dense(path, file.format, type->second, box, s.levels,
                   of_source.metadata ? std::optional(of_source.metadata->time_s) : std::nullopt);
    const VolumeLevel& top = encoded.levels.front();
    if (encoded.type != type->second || std::array{top.nx, top.ny, top.nz} != box.size)
        bad_file(path, "has another type or size than the list says");
    const bool one_level = file.format == "vti" || file.format == "slices";
    if (encoded.levels.size() != std::size_t(one_level ? 1 : s.levels))
        bad_file(path, "has another number of levels than the list says");
    const bool has_bricks = file.format == "bricks";
    // Voxels of the source, and afterwards beside them those of the codes; of bricks all levels, and the file once more.
    const std::uint64_t of_bricks =
        has_bricks ? size_of_file(path) + encoded_bytes(level_sizes(box.size, s.levels), VoxelType::r32f) : 0;
    require_room(
        path,
        of_bricks + std::max(2 * sizeof(float) * box.voxels(), layout_bytes(box.voxels(), s.layout.factor)),
        box);
    Volume expected = lay_out(source, s.layout);
    std::vector<Volume> levels;  // of bricks, which have borders beside their levels
    const bool whole = encoded.type == VoxelType::r16f || encoded.type == VoxelType::r32f;
    const float most = whole ? std::max(s.scale, source.max_value()) : s.scale;
    const Tolerance tolerance = tolerance_of(encoded.type, double(s.scale));
    for (const VolumeLevel& level : encoded.levels) {
        if (&level != &top) expected = halved(expected);
        const std::vector<float> found = decode(level.bytes.data(), level.bytes.size(), level.nx, level.ny,
                                                level.nz, encoded.type, s.scale)
                                             .values;
        if (encoded.type == VoxelType::bc4)
            compare(path, expected.values, found, BlockTolerance(expected, double(s.scale)), d, most);
        else
            compare(
                path, expected.values, found,
                [&](std::size_t n) { return tolerance.of(double(expected.values[n])); }, d, most);
        if (has_bricks) levels.push_back(expected);
    }
    if (has_bricks && d.too_far == 0)
        check_bricks(path, levels, {list.brick_edge, encoded.type, s.scale, repeating_axes(box, s.layout)},
                     most, [&](float value) { return tolerance.of(double(value)); });
    return true;
}

std::vector<Check> check_voxels(const std::filesystem::path& folder, const ListedExport& list) {
    std::map<std::string, Difference> formats;
    std::map<std::string, std::size_t> counts;
    Problems bad, unread;
    std::size_t lost = 0, changed = 0, of_sources = 0;
    for (const ExportedFile& file : list.files) {
        if (file.source.empty()) continue;
        ++of_sources;
        bool is_changed = false;  // then it may be why they differ
        try {
            const ListedExport::Sequence* s = sequence_of(list, file.path.generic_string());
            if (s == nullptr || !is_there(folder / file.source)) {
                ++lost;
                continue;
            }
            is_changed = file.source_digest && !(file_digest(folder / file.source) == *file.source_digest);
            if (compare_file(folder, list, *s, file, formats[file.format])) ++counts[file.format];
            changed += is_changed;
        } catch (const ReadFailure& failure) {  // which says nothing of its content
            if (!is_of_file(folder, failure)) throw;
            unread.add(failure.what());
        } catch (const std::bad_alloc&) {
            unread.add((folder / file.path).string() + ": cannot compare with its source: out of memory");
        } catch (const Error& failure) {
            const bool is_bad = is_of_file(folder / file.path, failure);
            if (!is_bad && !is_of_file(folder / file.source, failure)) throw;
            (is_bad ? bad : unread).add(failure.what());
            changed += is_changed && is_bad;
        }
    }
    std::vector<Check> checks;
    for (const auto& [format, d] : formats) {
        if (counts[format] == 0) continue;
        const double rms = std::sqrt(d.squares / double(std::max<std::size_t>(1, d.voxels)));
        checks.push_back(
            {format,
             d.too_far == 0,
             fmt::format("{} files read back: largest difference {:.3g} (at most {:.3g}), rms {:.3g}{}{}",
                         counts[format], d.largest, d.allowed, rms,
                         d.too_far > 0 ? fmt::format("; a voxel differs by {:.3g} instead of {:.3g} at most",
                                                     d.too_far, d.instead_of)
                                       : "",
                         d.cut > 0 ? fmt::format("; {} voxels above the scale are cut to it", d.cut) : ""),
             {{"largest", d.largest}, {"rms", rms}}});
    }
    if (!bad.none()) checks.push_back(bad.check("voxels", ""));
    if (changed > 0)
        checks.push_back(
            {"sources", std::ranges::all_of(checks, [](const Check& check) { return check.passed; }),
             fmt::format("{} files were made of sources that have changed since: the same export makes them "
                         "anew",
                         changed)});
    if (lost > 0)
        checks.push_back(
            {"missing sources",
             true,
             fmt::format("{} of {} files were not compared: their sources are not there any more{}", lost,
                         of_sources,
                         lost == of_sources ? "; only checksums and sidecars were looked at" : ""),
             {{"not_compared", double(lost)}, {"of", double(of_sources)}}});
    if (!unread.none()) checks.push_back(unread.not_done("decoding"));
    return checks;
}

}  // namespace

const ListedExport::Sequence* sequence_of(const ListedExport& list, const std::string& name) {
    const ListedExport::Sequence* best = nullptr;
    for (const ListedExport::Sequence& s : list.sequences) {
        if (name.starts_with(s.name + "_") && (best == nullptr || s.name.size() > best->name.size()))
            best = &s;
    }
    return best;
}

bool is_of_file(const std::filesystem::path& path, const Error& error) {
    return std::string_view(error.what()).starts_with(path.string());
}

Verification verify_export(const std::filesystem::path& folder, const VerifyOptions& options) {
    const ListedExport list = read_export(folder);
    if (options.against || options.replay > 0 || options.seam || options.max_change)
        throw Error(
            ErrorCode::usage,
            folder.string() + ": is an export; --against, --replay, --seam and --max-change are for runs");
    Verification result{"export", {check_list(folder / "export.json")}};
    std::vector<ListedFile> files;
    std::set<std::filesystem::path> names{"export.json"};
    for (const ExportedFile& file : list.files) {
        files.push_back({file.path, file.digest.bytes, file.digest.xxh3});
        names.insert(file.path);
    }
    if (!list.complete) {
        names.insert(kExportWork);
        try {
            for (const ExportedFile& file : noted_files(folder)) names.insert(file.path);
        } catch (const Error&) {  // another user's; what they name is then told as listed nowhere
        }
    }
    std::vector<std::filesystem::path> extra;
    Problems unlisted;
    try {
        for (const std::string& name : names_in_folder(folder))
            if (!names.contains(name)) extra.emplace_back(name);
    } catch (const ReadFailure& failure) {
        unlisted.add(failure.what());
    }
    const bool is_empty = extra.empty() && unlisted.none() &&
                          names == std::set<std::filesystem::path>{"export.json", kExportWork};
    if (!list.complete)
        result.checks.push_back(
            {"complete", false,
             is_empty ? "the export has made nothing yet: it was refused or interrupted"
                      : "the export was interrupted or refused: the same command goes on, or says why not"});
    for (Check& check : check_files(folder, files, extra, unlisted.none()))
        result.checks.push_back(std::move(check));
    if (!unlisted.none()) result.checks.push_back(unlisted.not_done("listing"));
    if (!options.hashes_only) {
        for (Check& check : check_sidecars(folder, list)) result.checks.push_back(std::move(check));
        for (Check& check : check_voxels(folder, list)) result.checks.push_back(std::move(check));
    }
    return result;
}

}  // namespace nephos
