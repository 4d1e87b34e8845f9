// SPDX-License-Identifier: Apache-2.0
#include "density/export/cloud_picture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <deque>
#include <new>
#include <optional>

#include "core/atomic_file.h"
#include "core/png/png_input.h"
#include "density/export/png_bytes.h"
#include "density/export/whole_file.h"

namespace nephos {
namespace {

constexpr int kSides[] = {32, 64, 128};
constexpr int kMostHigh = 2048;       // layers of a texture that every OpenGL 4 has (GL_MAX_3D_TEXTURE_SIZE)
constexpr std::size_t kChannels = 4;  // red, green, blue, alpha
constexpr float kDense = 0.3f;        // of the largest density: what hangs together is one cloud
constexpr int kEdge = 3;              // voxels of thin cloud around it

// A voxel of a cloud and where it lies from the cloud's first one, across periodic sides without a jump.
struct Member {
    std::size_t index;
    std::array<int, 3> place;
};
using Members = std::deque<Member>;  // grows without a copy of what it has

class Clouds {
  public:
    Clouds(const Volume& v, const std::array<bool, 3>& periodic, float scale)
        : volume_(v),
          size_{v.nx, v.ny, v.nz},
          stride_{1, std::size_t(v.nx), std::size_t(v.nx) * std::size_t(v.ny)},
          periodic_(periodic),
          unseen_(v.values.size()) {
        least_ = 0.5f / 255 * scale;
        const float most = v.values.empty() ? 0 : *std::ranges::max_element(v.values);
        mark(std::max(least_, kDense * most));
    }

    // The voxels of the cloud of the greatest mass, of equal ones the first.
    Members largest() {
        Members best, cloud;
        double most = 0;
        for (std::size_t n = 0; (n = next_unseen(n)) < unseen_.size();) {
            gather_cloud(n, cloud);
            double mass = 0;
            for (const Member& member : cloud) mass += double(volume_.values[member.index]);
            if (mass <= most) continue;
            most = mass;
            std::swap(best, cloud);
        }
        Members().swap(cloud);  // its memory, too: the other grows
        add_edge(best);
        return best;
    }

  private:
    void mark(float least) {
        for (std::size_t n = 0; n < unseen_.size(); ++n) unseen_[n] = volume_.values[n] >= least ? 1 : 0;
    }

    // The first of the marked voxels from `n` on; their number where there is none.
    std::size_t next_unseen(std::size_t n) const {
        const void* found = n < unseen_.size() ? std::memchr(unseen_.data() + n, 1, unseen_.size() - n) : nullptr;
        return found != nullptr ? std::size_t(static_cast<const std::uint8_t*>(found) - unseen_.data()) : unseen_.size();
    }

    void gather_cloud(std::size_t first, Members& cloud) {
        const auto nx = std::size_t(size_[0]), ny = std::size_t(size_[1]);
        cloud.assign(1, {first, {int(first % nx), int(first / nx % ny), int(first / nx / ny)}});
        unseen_[first] = 0;
        for (std::size_t n = 0; n < cloud.size(); ++n) add_neighbours(n, cloud);
    }

    void add_edge(Members& cloud) {
        mark(least_);
        for (const Member& member : cloud) unseen_[member.index] = 0;
        for (std::size_t ring = 0, begin = 0; ring < std::size_t(kEdge); ++ring) {
            const std::size_t end = cloud.size();
            for (std::size_t n = begin; n < end; ++n) add_neighbours(n, cloud);
            begin = end;
        }
    }

    // Adds the marked voxels beside one of a cloud to it.
    void add_neighbours(std::size_t n, Members& cloud) {
        const Member member = cloud[n];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int size = size_[axis];
            const auto stride = std::ptrdiff_t(stride_[axis]);
            const int at = int(member.index / stride_[axis] % std::size_t(size));  // in the box
            for (const int step : {-1, 1}) {
                std::ptrdiff_t index = std::ptrdiff_t(member.index) + step * stride;
                if (at + step < 0 || at + step >= size) {
                    if (!periodic_[axis]) continue;
                    index -= step * stride * size;
                }
                if (unseen_[std::size_t(index)] == 0) continue;
                unseen_[std::size_t(index)] = 0;
                cloud.push_back({std::size_t(index), member.place});
                cloud.back().place[axis] += step;
            }
        }
    }

    const Volume& volume_;
    const std::array<int, 3> size_;
    const std::array<std::size_t, 3> stride_;
    const std::array<bool, 3> periodic_;
    std::vector<std::uint8_t> unseen_;  // 1: marked, and in no cloud yet
    float least_ = 0;           // what is cloud at all
};

}  // namespace

CloudVoxels largest_cloud(const Volume& volume, const std::array<bool, 3>& periodic, float scale) {
    const Members members = Clouds(volume, periodic, scale).largest();
    if (members.empty())
        return {kSides[0], 1, std::vector<std::uint8_t>(std::size_t(kSides[0]) * kSides[0]), 0};
    std::array<int, 3> low = members.front().place, high = low;
    for (const Member& member : members)
        for (std::size_t a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], member.place[a]);
            high[a] = std::max(high[a], member.place[a]);
        }
    const int widest = std::max(high[0] - low[0], high[1] - low[1]) + 1;
    const int most = *std::rbegin(kSides), tall = high[2] - low[2] + 1;
    const int factor = std::max((widest + most - 1) / most, (tall + kMostHigh - 1) / kMostHigh);
    CloudVoxels cloud;
    cloud.side = *std::ranges::lower_bound(kSides, (widest + factor - 1) / factor);
    cloud.height = (tall + factor - 1) / factor;
    std::array<int, 3> first = low;
    for (std::size_t a = 0; a < 2; ++a) first[a] -= (cloud.side * factor - (high[a] - low[a] + 1)) / 2;
    std::vector<double> sums(std::size_t(cloud.side) * std::size_t(cloud.side) * std::size_t(cloud.height));
    for (const Member& member : members) {
        std::array<std::size_t, 3> at{};
        for (std::size_t a = 0; a < 3; ++a) at[a] = std::size_t((member.place[a] - first[a]) / factor);
        sums[(at[2] * std::size_t(cloud.side) + at[1]) * std::size_t(cloud.side) + at[0]] +=
            double(volume.values[member.index]);
    }
    const double to_code = 255 / (double(scale) * factor * factor * factor);
    cloud.codes.reserve(sums.size());
    const double whole = 255 * (1 + 1e-6);  // means are rounded
    for (const double sum : sums) {
        cloud.cut += sum * to_code > whole;
        cloud.codes.push_back(std::uint8_t(std::min(255.0, sum * to_code) + 0.5));
    }
    return cloud;
}

std::uint64_t largest_cloud_bytes(const std::array<int, 3>& size, const std::array<bool, 3>& periodic,
                                  int factor, std::uint64_t positive) {
    const std::uint64_t voxels = std::uint64_t(size[0]) * std::uint64_t(size[1]) * std::uint64_t(size[2]);
    // Marks; and members, with a fifteenth more that the blocks of a deque take. All may be of one cloud.
    const std::uint64_t members = sizeof(Member) * std::min(positive, voxels),
                        cloud = voxels * sizeof(std::uint8_t) + members + members / 15;
    // Sums and codes of the cloud's own box. Across periodic sides it may be larger than its sky.
    const int most = *std::rbegin(kSides), widest = std::min(most, std::max(size[0], size[1]));
    const auto side =
        std::uint64_t(periodic[0] || periodic[1] ? most : *std::ranges::lower_bound(kSides, widest));
    const auto height = std::uint64_t(periodic[2] ? kMostHigh : std::min(size[2], kMostHigh));
    const std::uint64_t box = side * side * height * (sizeof(double) + sizeof(std::uint8_t));
    return std::max(layout_bytes(voxels, factor), voxels * sizeof(float) + cloud + box);
}

void write_cloud_picture(const std::filesystem::path& path, const CloudVoxels& cloud, double type) {
    const auto side = std::size_t(cloud.side), width = side * std::size_t(cloud.height);
    const auto green = std::uint8_t(std::lround(255 * std::clamp(type, 0.0, 1.0)));
    const PngShape shape{std::uint32_t(width), std::uint32_t(side), 8, int(kChannels)};
    const std::string png = png_bytes(path, shape, [&](std::uint32_t line, std::span<std::byte> row) {
        const std::size_t j = side - 1 - line;
        std::byte* pixel = row.data();
        for (std::size_t k = 0; k < std::size_t(cloud.height); ++k) {
            const std::uint8_t* codes = cloud.codes.data() + (k * side + j) * side;
            for (std::size_t i = 0; i < side; ++i, pixel += kChannels) {
                pixel[0] = std::byte{0};
                pixel[1] = std::byte(codes[i] > 0 ? green : 0);
                pixel[2] = std::byte(codes[i]);
                pixel[3] = std::byte{255};
            }
        }
    });
    write_atomically(path, std::string_view(png));
}

CloudVoxels read_cloud_picture(const std::filesystem::path& path) {
    return with_whole_file(path, [](ByteReader& reader) {
        PngInput picture(reader.rest(), {});
        CloudVoxels cloud{picture.height(), picture.width() / picture.height(), {}, 0};
        const bool known = std::ranges::find(kSides, cloud.side) != std::end(kSides);
        if (!known || picture.width() % picture.height() != 0 || picture.channels() != int(kChannels) ||
            picture.bits() != 8)
            throw Error(ErrorCode::io, "it is no picture of a cloud's voxels");
        const std::vector<std::byte> samples = picture.samples();
        if (picture.goes_on()) throw Error(ErrorCode::io, "it goes on behind its picture");
        const auto side = std::size_t(cloud.side), width = std::size_t(picture.width());
        std::optional<std::uint8_t> type;
        cloud.codes.resize(side * side * std::size_t(cloud.height));
        for (std::size_t k = 0; k < std::size_t(cloud.height); ++k)
            for (std::size_t j = 0; j < side; ++j)
                for (std::size_t i = 0; i < side; ++i) {
                    const std::byte* bytes =
                        samples.data() + ((side - 1 - j) * width + k * side + i) * kChannels;
                    const auto sample = [&](int c) { return std::to_integer<std::uint8_t>(bytes[c]); };
                    const std::uint8_t code = sample(2);
                    cloud.codes[(k * side + j) * side + i] = code;
                    if (code > 0) type = type.value_or(sample(1));
                    if (sample(0) != 0 || sample(1) != (code > 0 ? *type : 0) || sample(3) != 255)
                        throw Error(ErrorCode::io,
                                    "its voxels are not opaque, without red, and of one type: expected a "
                                    "picture that nephos has written");
                }
        return cloud;
    });
}

}  // namespace nephos
