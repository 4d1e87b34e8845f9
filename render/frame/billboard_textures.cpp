// SPDX-License-Identifier: Apache-2.0
#include "render/frame/billboard_textures.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/math.h"
#include "core/noise_hash.h"

namespace nephos {
namespace {

// Uses + - * / and sqrt alone, so that the textures have the same bytes with every C library.

// 0..1, a function of its arguments.
double random_at(std::uint32_t seed, int x, int y) {
    return mix_bits(mix_bits(seed + 0x9e3779b9u * std::uint32_t(x)) ^ 0x85ebca6bu * std::uint32_t(y)) /
           4294967295.0;
}

double mix(double a, double b, double t) { return a + (b - a) * t; }

// Values at the integer points, interpolated with zero slope there; 0..1.
double value_noise(std::uint32_t seed, double x, double y) {
    const double fx = std::floor(x), fy = std::floor(y);
    const int i = int(fx), j = int(fy);
    const double u = smoothstep(0, 1, x - fx), v = smoothstep(0, 1, y - fy);
    return mix(mix(random_at(seed, i, j), random_at(seed, i + 1, j), u),
               mix(random_at(seed, i, j + 1), random_at(seed, i + 1, j + 1), u), v);
}

// Octaves of half the size and half the weight each; 0..1, mean 0.5. Each is turned, or their lattices would
// show.
double fractal_noise(std::uint32_t seed, double x, double y, int octaves) {
    double sum = 0, weight = 0.5, total = 0;
    for (int octave = 0; octave < octaves; ++octave, weight *= 0.5) {
        sum += weight * value_noise(seed + std::uint32_t(octave) * 101u, x, y);
        total += weight;
        const double turned = 1.6 * x + 1.2 * y;
        y = -1.2 * x + 1.6 * y + 17.3;
        x = turned + 5.7;
    }
    return sum / total;
}

struct Texel {
    double opacity = 0, brightness = 1;
};

// Evaluates the soft texture: a ball of haze with a slightly ragged rim.
Texel soft_billboard(std::uint32_t seed, double x, double y) {
    const double ragged = fractal_noise(seed, 2.2 * x + 9, 2.2 * y + 9, 5) - 0.5;
    const double fine = fractal_noise(seed + 7, 5 * x + 31, 5 * y + 31, 4) - 0.5;
    const double r = 0.82 * std::sqrt(x * x + y * y) + 0.75 * ragged;
    const double body = 1 - smoothstep(0.05, 0.85, r);
    return {0.8 * body * std::clamp(1 + 0.7 * fine, 0.0, 1.2),
            0.86 + 0.14 * std::clamp(0.5 + 2 * fine, 0.0, 1.0)};
}

// Fibres along x, bent together, with gaps between them.
Texel wisp(std::uint32_t seed, double x, double y) {
    const double arch = 0.5 * random_at(seed, 0, 0) - 0.25;
    const double bend =
        0.5 * (fractal_noise(seed + 3, 1.1 * x + 3, 0.6 * y + 3, 3) - 0.5) + arch * (x * x - 0.3);
    const double across = y + bend;
    const double fibres = fractal_noise(seed, 1.3 * x + 20, 7 * across + 20, 5);
    const double strands =
        1 - 2 * std::abs(fractal_noise(seed + 5, 0.9 * x + 40, 3.5 * across + 40, 4) - 0.5);
    const double patches = smoothstep(0.3, 0.7, fractal_noise(seed + 9, 1.4 * x + 60, 1.4 * y + 60, 3));
    const double body = 1 - smoothstep(0.1, 0.95, std::sqrt(0.85 * x * x + 1.4 * across * across));
    const double fibre = smoothstep(0.3, 0.75, fibres) * strands * strands;
    return {0.85 * body * fibre * (0.35 + 0.65 * patches), 0.95 + 0.05 * fibres};
}

// Small domes about a large one: a firm rim of knobs, brighter where a dome bulges towards the eye.
Texel cauliflower(std::uint32_t seed, double x, double y) {
    const double wobble_x = 0.16 * (fractal_noise(seed + 11, 4 * x + 5, 4 * y + 5, 4) - 0.5);
    const double wobble_y = 0.16 * (fractal_noise(seed + 13, 4 * x + 55, 4 * y + 55, 4) - 0.5);
    double thickness = 0, bulge = 0;
    constexpr int kDomes = 26;
    for (int dome = 0; dome < kDomes; ++dome) {
        const double radius = dome == 0 ? 0.55 : 0.16 + 0.18 * random_at(seed, dome, 0);
        double cx = 0, cy = 0;
        if (dome > 0) {
            // In a disc: the point of the square, pulled towards the middle along its longer coordinate.
            const double a = 2 * random_at(seed, dome, 1) - 1, b = 2 * random_at(seed, dome, 2) - 1;
            const double length = std::sqrt(a * a + b * b) + 1e-9;
            const double reach = (0.96 - radius) * std::max(std::abs(a), std::abs(b)) / length;
            cx = a * reach;
            cy = b * reach;
        }
        const double dx = x + wobble_x - cx, dy = y + wobble_y - cy;
        const double inside = radius * radius - dx * dx - dy * dy;
        if (inside <= 0) continue;
        const double height = std::sqrt(inside);
        thickness += height;
        bulge = std::max(bulge, height / radius);
    }
    const double fine = fractal_noise(seed + 17, 6 * x + 71, 6 * y + 71, 4) - 0.5;
    const double opacity = smoothstep(0.0, 0.75, thickness * (1 + 0.8 * fine));
    return {0.97 * opacity, 0.74 + 0.26 * std::clamp(bulge * bulge + 0.5 * fine, 0.0, 1.0)};
}

// Not even the raggedest picture reaches the circle that touches the sides.
Texel bounded(Texel texel, double x, double y) {
    texel.opacity *= 1 - smoothstep(0.8, 0.985, std::sqrt(x * x + y * y));
    return texel;
}

std::uint8_t to_byte(double value) { return std::uint8_t(std::clamp(value, 0.0, 1.0) * 255 + 0.5); }

BillboardLevel finest_level() {
    BillboardLevel level{kBillboardTexels, {}};
    level.texels.reserve(std::size_t(2) * kBillboardKinds * kBillboardVariants * kBillboardTexels *
                         kBillboardTexels);
    constexpr Texel (*kKinds[kBillboardKinds])(std::uint32_t, double, double) = {&soft_billboard, &wisp,
                                                                                 &cauliflower};
    for (int layer = 0; layer < kBillboardKinds * kBillboardVariants; ++layer) {
        const std::uint32_t seed = mix_bits(std::uint32_t(layer) + 1);
        for (int j = 0; j < kBillboardTexels; ++j) {
            for (int i = 0; i < kBillboardTexels; ++i) {
                const double x = 2 * (i + 0.5) / kBillboardTexels - 1,
                             y = 1 - 2 * (j + 0.5) / kBillboardTexels;
                const Texel texel = bounded(kKinds[layer / kBillboardVariants](seed, x, y), x, y);
                level.texels.push_back(to_byte(texel.opacity));
                level.texels.push_back(to_byte(texel.opacity * texel.brightness));
            }
        }
    }
    return level;
}

// Computes the next level: the mean of 2x2 texels.
BillboardLevel coarser(const BillboardLevel& fine) {
    BillboardLevel level{fine.side / 2, {}};
    const std::size_t side = std::size_t(fine.side), layers = fine.texels.size() / (2 * side * side);
    for (std::size_t layer = 0; layer < layers; ++layer) {
        for (std::size_t j = 0; j < side; j += 2) {
            for (std::size_t i = 0; i < side; i += 2) {
                for (std::size_t c = 0; c < 2; ++c) {
                    const std::uint8_t* at = &fine.texels[2 * ((layer * side + j) * side + i) + c];
                    level.texels.push_back(
                        std::uint8_t((at[0] + at[2] + at[2 * side] + at[2 * side + 2] + 2) / 4));
                }
            }
        }
    }
    return level;
}

constexpr int kExactSide = 32;  // pictures from elsewhere keep their opacity on levels at least as fine

// Clears the outermost texels of each layer and, unless they are `exact`, scales the others such that the layer hides
// as much as before.
void clear_rim(BillboardLevel& level, bool exact) {
    const std::size_t side = std::size_t(level.side), layer_bytes = 2 * side * side;
    for (std::size_t begin = 0; begin < level.texels.size(); begin += layer_bytes) {
        std::uint64_t all = 0, rim = 0;
        const auto is_rim = [&](std::size_t at) {
            const std::size_t i = at / 2 % side, j = at / 2 / side;
            return i == 0 || j == 0 || i + 1 == side || j + 1 == side;
        };
        for (std::size_t at = 0; at < layer_bytes; at += 2) {
            all += level.texels[begin + at];
            if (is_rim(at)) rim += level.texels[begin + at];
        }
        const double scale = !exact && all > rim ? double(all) / double(all - rim) : 1.0;
        for (std::size_t at = 0; at < layer_bytes; ++at) {
            std::uint8_t& texel = level.texels[begin + at];
            texel = is_rim(at) ? 0 : to_byte(scale * texel / 255);
        }
    }
}

// `own`: of pictures from elsewhere.
std::vector<BillboardLevel> levels_from(BillboardLevel finest, bool own) {
    std::vector<BillboardLevel> levels{std::move(finest)};
    while (int(levels.size()) < kBillboardLevels) levels.push_back(coarser(levels.back()));
    for (BillboardLevel& level : levels) clear_rim(level, own && level.side >= kExactSide);
    return levels;
}

void append_level(const BillboardLevel& level, BillboardTexels& out) {
    const std::size_t side = std::size_t(level.side), layers = level.texels.size() / (2 * side * side);
    const std::size_t stride = side + 2;
    out.first.push_back(std::uint32_t(out.texels.size()));
    out.texels.resize(out.texels.size() + 2 * layers * stride * stride, 0);
    std::uint32_t* to = &out.texels[out.first.back()];
    for (std::size_t layer = 0; layer < 2 * layers; ++layer, to += stride * stride) {
        for (std::size_t j = 0; j < side; ++j) {
            for (std::size_t i = 0; i < side; ++i) {
                const std::size_t row = layer < layers ? j : i, column = layer < layers ? i : j;
                const std::uint8_t* from = &level.texels[2 * ((layer % layers * side + row) * side + column)];
                const std::uint32_t texel = from[0] | std::uint32_t(from[1]) << 8;
                std::uint32_t* const at = to + (j + 1) * stride + i + 1;
                at[0] |= texel;
                at[-1] |= texel << 16;
            }
        }
    }
}

BillboardTexels texels_of(const std::vector<BillboardLevel>& levels) {
    BillboardTexels texels;
    const std::size_t side = std::size_t(levels.front().side);
    texels.layers = std::uint32_t(levels.front().texels.size() / (2 * side * side));
    for (const BillboardLevel& level : levels) append_level(level, texels);
    return texels;
}

// Mean of an image's values over the rectangle from (left, top) to (right, bottom), pixels.
float mean_over(const AlphaImage& image, const std::vector<float>& values, double left, double top, double right,
                double bottom) {
    double sum = 0, area = 0;
    for (int y = int(top); y < std::min(image.height, int(std::ceil(bottom))); ++y) {
        const double high = std::min(bottom, y + 1.0) - std::max(top, double(y));
        for (int x = int(left); x < std::min(image.width, int(std::ceil(right))); ++x) {
            const double part = high * (std::min(right, x + 1.0) - std::max(left, double(x)));
            sum += part * double(values[std::size_t(y) * std::size_t(image.width) + std::size_t(x)]);
            area += part;
        }
    }
    return area > 0 ? float(sum / area) : 0;
}

// A layer of the finest level: the image within the rim that is clear.
void append_image(const AlphaImage& image, std::vector<std::uint8_t>& texels) {
    constexpr int kInside = kBillboardTexels - 2;
    for (int j = -1; j <= kInside; ++j) {
        for (int i = -1; i <= kInside; ++i) {
            if (i < 0 || j < 0 || i == kInside || j == kInside) {
                texels.insert(texels.end(), 2, 0);
                continue;
            }
            const double across = double(image.width) / kInside, down = double(image.height) / kInside;
            for (const std::vector<float>* values : {&image.opacity, &image.bright})
                texels.push_back(to_byte(double(
                    mean_over(image, *values, i * across, j * down, (i + 1) * across, (j + 1) * down))));
        }
    }
}

}  // namespace

const std::vector<BillboardLevel>& billboard_textures() {
    static const std::vector<BillboardLevel> levels = levels_from(finest_level(), false);
    return levels;
}

std::shared_ptr<const BillboardPictures> billboard_pictures(std::size_t count,
                                                            const std::function<AlphaImage(std::size_t)>& image_of) {
    if (count > kMostBillboardPictures) {
        throw Error(ErrorCode::usage, std::to_string(count) + " pictures of billboards; expected at most " +
                                          std::to_string(kMostBillboardPictures));
    }
    static std::atomic<std::uint64_t> last_serial{0};
    BillboardLevel finest{kBillboardTexels, {}};
    for (std::size_t n = 0; n < count; ++n) {
        const AlphaImage image = image_of(n);
        const std::size_t pixels = std::size_t(std::max(image.width, 0)) * std::size_t(std::max(image.height, 0));
        if (pixels == 0 || image.opacity.size() != pixels || image.bright.size() != pixels)
            throw Error(ErrorCode::usage, "a picture of billboards: its values do not have the size that it states");
        append_image(image, finest.texels);
    }
    auto made = std::make_shared<BillboardPictures>();
    made->serial = ++last_serial;
    made->count = int(count);
    made->levels = billboard_textures();
    if (count > 0) {
        const std::vector<BillboardLevel> own = levels_from(std::move(finest), true);
        for (std::size_t n = 0; n < own.size(); ++n)
            made->levels[n].texels.insert(made->levels[n].texels.end(), own[n].texels.begin(), own[n].texels.end());
    }
    made->texels = texels_of(made->levels);
    return made;
}

const BillboardTexels& billboard_texels(const BillboardPictures* pictures) {
    static const BillboardTexels texels = texels_of(billboard_textures());
    return pictures != nullptr ? pictures->texels : texels;
}

BillboardPicture billboard_picture(BillboardTexture kind, std::uint32_t variant) {
    const std::uint32_t turns = kind == BillboardTexture::wispy ? 4 : 8;
    return {int(kind) * kBillboardVariants + int(variant % kBillboardVariants),
            int(variant / kBillboardVariants % turns)};
}

}  // namespace nephos
