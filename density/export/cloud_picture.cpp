// SPDX-License-Identifier: Apache-2.0
#include "density/export/cloud_picture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <png.h>

#include "core/atomic_file.h"
#include "density/export/whole_file.h"

namespace nephos {
namespace {

constexpr int kSides[] = {32, 64, 128};
constexpr std::size_t kChannels = 4;  // red, green, blue, alpha
constexpr float kDense = 0.3f;        // of the largest density: what hangs together is one cloud
constexpr int kEdge = 3;              // voxels of thin cloud around it

// A voxel of a cloud and where it lies from the cloud's first one, across periodic sides without a jump.
struct Member {
    std::size_t index;
    std::array<int, 3> place;
};

class Clouds {
  public:
    Clouds(const Volume& v, const std::array<bool, 3>& periodic, float scale)
        : volume_(v), size_{v.nx, v.ny, v.nz}, periodic_(periodic), unseen_(v.values.size()) {
        least_ = 0.5f / 255 * scale;
        const float most = v.values.empty() ? 0 : *std::ranges::max_element(v.values);
        mark(std::max(least_, kDense * most));
    }

    // The voxels of the cloud of the greatest mass, of equal ones the first.
    std::vector<Member> largest() {
        std::vector<Member> best;
        double most = 0;
        for (std::size_t n = 0; n < unseen_.size(); ++n) {
            if (!unseen_[n]) continue;
            std::vector<Member> cloud = cloud_from(n);
            double mass = 0;
            for (const Member& member : cloud) mass += double(volume_.values[member.index]);
            if (mass <= most) continue;
            most = mass;
            best = std::move(cloud);
        }
        add_edge(best);
        return best;
    }

  private:
    std::size_t index_of(const std::array<int, 3>& at) const {
        return (std::size_t(at[2]) * std::size_t(size_[1]) + std::size_t(at[1])) * std::size_t(size_[0]) +
               std::size_t(at[0]);
    }

    void mark(float least) {
        for (std::size_t n = 0; n < unseen_.size(); ++n) unseen_[n] = volume_.values[n] >= least;
    }

    std::vector<Member> cloud_from(std::size_t first) {
        const auto nx = std::size_t(size_[0]), ny = std::size_t(size_[1]);
        std::vector<Member> cloud{{first, {int(first % nx), int(first / nx % ny), int(first / nx / ny)}}};
        unseen_[first] = false;
        for (std::size_t n = 0; n < cloud.size(); ++n) add_neighbours(n, cloud);
        return cloud;
    }

    void add_edge(std::vector<Member>& cloud) {
        mark(least_);
        for (const Member& member : cloud) unseen_[member.index] = false;
        for (std::size_t ring = 0, begin = 0; ring < std::size_t(kEdge); ++ring) {
            const std::size_t end = cloud.size();
            for (std::size_t n = begin; n < end; ++n) add_neighbours(n, cloud);
            begin = end;
        }
    }

    // Adds the marked voxels beside one of a cloud to it.
    void add_neighbours(std::size_t n, std::vector<Member>& cloud) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            for (const int step : {-1, 1}) {
                std::array<int, 3> place = cloud[n].place;
                place[axis] += step;
                std::array<int, 3> at = place;
                for (std::size_t a = 0; a < 3; ++a)
                    if (periodic_[a]) at[a] = ((at[a] % size_[a]) + size_[a]) % size_[a];
                if (at[axis] < 0 || at[axis] >= size_[axis]) continue;
                const std::size_t index = index_of(at);
                if (!unseen_[index]) continue;
                unseen_[index] = false;
                cloud.push_back({index, place});
            }
        }
    }

    const Volume& volume_;
    const std::array<int, 3> size_;
    const std::array<bool, 3> periodic_;
    std::vector<bool> unseen_;  // marked, and in no cloud yet
    float least_ = 0;           // what is cloud at all
};

}  // namespace

CloudVoxels largest_cloud(const Volume& volume, const std::array<bool, 3>& periodic, float scale) {
    const std::vector<Member> members = Clouds(volume, periodic, scale).largest();
    if (members.empty()) return {kSides[0], 1, std::vector<std::uint8_t>(std::size_t(kSides[0]) * kSides[0])};
    std::array<int, 3> low = members.front().place, high = low;
    for (const Member& member : members)
        for (std::size_t a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], member.place[a]);
            high[a] = std::max(high[a], member.place[a]);
        }
    const int widest = std::max(high[0] - low[0], high[1] - low[1]) + 1;
    const int most = *std::rbegin(kSides), factor = (widest + most - 1) / most;
    CloudVoxels cloud;
    cloud.side = *std::ranges::lower_bound(kSides, (widest + factor - 1) / factor);
    cloud.height = (high[2] - low[2]) / factor + 1;
    std::array<int, 3> first = low;
    for (std::size_t a = 0; a < 2; ++a) first[a] -= (cloud.side * factor - (high[a] - low[a] + 1)) / 2;
    std::vector<float> sums(std::size_t(cloud.side) * std::size_t(cloud.side) * std::size_t(cloud.height));
    for (const Member& member : members) {
        std::array<std::size_t, 3> at{};
        for (std::size_t a = 0; a < 3; ++a) at[a] = std::size_t((member.place[a] - first[a]) / factor);
        sums[(at[2] * std::size_t(cloud.side) + at[1]) * std::size_t(cloud.side) + at[0]] +=
            volume.values[member.index];
    }
    const float to_code = 255 / (scale * float(factor) * float(factor) * float(factor));
    for (const float sum : sums) cloud.codes.push_back(std::uint8_t(std::min(255.0f, sum * to_code) + 0.5f));
    return cloud;
}

void write_cloud_picture(const std::filesystem::path& path, const CloudVoxels& cloud, double type) {
    const auto side = std::size_t(cloud.side), width = side * std::size_t(cloud.height);
    std::vector<std::uint8_t> pixels(width * side * kChannels);
    const auto green = std::uint8_t(std::lround(255 * std::clamp(type, 0.0, 1.0)));
    for (std::size_t k = 0; k < std::size_t(cloud.height); ++k)
        for (std::size_t j = 0; j < side; ++j)
            for (std::size_t i = 0; i < side; ++i) {
                const std::uint8_t code = cloud.codes[(k * side + j) * side + i];
                std::uint8_t* pixel = pixels.data() + ((side - 1 - j) * width + k * side + i) * kChannels;
                pixel[1] = code > 0 ? green : 0;
                pixel[2] = code;
                pixel[3] = 255;
            }
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(width);
    image.height = png_uint_32(side);
    image.format = PNG_FORMAT_RGBA;
    png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::vector<std::byte> file(bytes);
    if (png_image_write_to_memory(&image, file.data(), &bytes, 0, pixels.data(), 0, nullptr) == 0)
        throw Error(ErrorCode::io, path.string() + ": libpng cannot encode the cloud: " + image.message);
    write_atomically(path, std::span<const std::byte>(file).first(bytes));
}

CloudVoxels read_cloud_picture(const std::filesystem::path& path) {
    return with_whole_file(path, [](ByteReader& reader) {
        const std::span<const std::byte> bytes = reader.rest();
        png_image image{};
        image.version = PNG_IMAGE_VERSION;
        if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0)
            throw Error(ErrorCode::io, "it is no PNG file, or is damaged");
        image.format = PNG_FORMAT_RGBA;
        CloudVoxels cloud{int(image.height), int(image.width / std::max(1u, image.height)), {}};
        const bool known = std::ranges::find(kSides, cloud.side) != std::end(kSides);
        // PNG packs at most 1,032 bytes into one: what states more is damaged, and needs no memory.
        if (!known || image.width % image.height != 0 ||
            std::uint64_t(image.width) * image.height * kChannels >
                1032 * std::uint64_t(bytes.size()) + 1024) {
            png_image_free(&image);
            throw Error(ErrorCode::io, "it is no picture of a cloud's voxels");
        }
        std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
        if (png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr) == 0)
            throw Error(ErrorCode::io, "it is no PNG file, or is damaged");
        const auto side = std::size_t(cloud.side), width = std::size_t(image.width);
        cloud.codes.resize(side * side * std::size_t(cloud.height));
        for (std::size_t k = 0; k < std::size_t(cloud.height); ++k)
            for (std::size_t j = 0; j < side; ++j)
                for (std::size_t i = 0; i < side; ++i)
                    cloud.codes[(k * side + j) * side + i] =
                        pixels[((side - 1 - j) * width + k * side + i) * kChannels + 2];
        return cloud;
    });
}

}  // namespace nephos
