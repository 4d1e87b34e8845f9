// SPDX-License-Identifier: Apache-2.0
#include "study/packed_series.h"

#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <new>
#include <optional>

#include <zlib.h>

#include "core/bytes.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr char kWithScales = 1;     // no deflated text begins so
constexpr std::size_t kMostSeries = 64;
constexpr std::size_t kScaleBytes = 1 + 3 * sizeof(double) + sizeof(std::int8_t);

using Numbers = std::vector<std::uint32_t>;

void require_whole(bool holds) {
    if (!holds) throw Error(ErrorCode::io, "packed series are damaged");
}

// Small differences of either sign become small numbers: 0, -1, 1, -2, ...
std::uint32_t zigzag(std::uint32_t difference) { return difference << 1 ^ (0 - (difference >> 31)); }
std::uint32_t from_zigzag(std::uint32_t number) { return number >> 1 ^ (0 - (number & 1)); }

float value_of(const SeriesScale& scale, std::uint32_t n, double divisor) {
    if (divisor == 0) return std::numeric_limits<float>::quiet_NaN();
    return float(scale.offset + double(n) / divisor * scale.scale);
}

double divisor_of(const SeriesScale& scale, std::span<const Numbers> known, std::size_t at) {
    return scale.by < 0 ? scale.divisor : double(known[std::size_t(scale.by)][at]);
}

// The whole numbers of a series; nothing where one value does not come out of its own.
std::optional<Numbers> whole_numbers(std::span<const float> values, const SeriesScale& scale,
                                     std::span<const Numbers> known) {
    if (scale.by >= 0 && known[std::size_t(scale.by)].empty()) return std::nullopt;
    Numbers numbers;
    numbers.reserve(values.size());
    for (const float value : values) {
        const double divisor = divisor_of(scale, known, numbers.size());
        const double n = divisor == 0 ? 0 : std::round((value - scale.offset) / scale.scale * divisor);
        if (!(n >= 0 && n < 0x1p31)) return std::nullopt;
        numbers.push_back(std::uint32_t(n));
        if (std::bit_cast<std::uint32_t>(value_of(scale, numbers.back(), divisor)) !=
            std::bit_cast<std::uint32_t>(value))
            return std::nullopt;
    }
    return numbers;
}

Numbers bits_of(std::span<const float> values) {
    Numbers numbers;
    for (const float value : values) numbers.push_back(std::bit_cast<std::uint32_t>(value));
    return numbers;
}

std::string deflated(std::span<const std::byte> bytes) {
    uLongf size = compressBound(uLong(bytes.size()));
    std::string packed(size, '\0');
    const int status = compress2(static_cast<Bytef*>(static_cast<void*>(packed.data())), &size,
                                 static_cast<const Bytef*>(static_cast<const void*>(bytes.data())),
                                 uLong(bytes.size()), Z_BEST_COMPRESSION);
    if (status != Z_OK) throw std::bad_alloc();  // with room enough nothing else can go wrong
    packed.resize(size);
    return packed;
}

// At most `most` bytes.
std::vector<std::byte> inflated(std::string_view packed, std::size_t most) {
    std::vector<std::byte> bytes(most);
    uLongf size = uLongf(most);
    const int status =
        uncompress(static_cast<Bytef*>(static_cast<void*>(bytes.data())), &size,
                   static_cast<const Bytef*>(static_cast<const void*>(packed.data())), uLong(packed.size()));
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    require_whole(status == Z_OK);
    bytes.resize(size);
    return bytes;
}

// The bytes of the differences of all series, one behind the other.
std::vector<std::byte> planes_of(std::span<const Numbers> series) {
    Numbers differences;
    std::uint32_t before = 0;
    for (const Numbers& numbers : series) {
        for (const std::uint32_t number : numbers) {
            differences.push_back(zigzag(number - before));
            before = number;
        }
    }
    std::vector<std::byte> planes(4 * differences.size());
    auto to = planes.begin();
    for (int shift = 24; shift >= 0; shift -= 8)
        for (const std::uint32_t difference : differences) *to++ = std::byte(difference >> shift);
    return planes;
}

Numbers numbers_in(std::span<const std::byte> planes) {
    const std::size_t count = planes.size() / 4;
    Numbers numbers(count);
    std::uint32_t before = 0;
    for (std::size_t n = 0; n < count; ++n) {
        std::uint32_t number = 0;
        for (std::size_t byte = 0; byte < 4; ++byte)
            number = number << 8 | std::to_integer<std::uint32_t>(planes[byte * count + n]);
        numbers[n] = before += from_zigzag(number);
    }
    return numbers;
}

// The scale of the series that comes after those of `before`.
std::optional<SeriesScale> read_scale(ByteReader& reader,
                                      std::span<const std::optional<SeriesScale>> before) {
    require_whole(!reader.rest().empty());
    const std::uint8_t has_scale = reader.get<std::uint8_t>();
    require_whole(has_scale <= 1);
    if (has_scale == 0) return std::nullopt;
    require_whole(reader.rest().size() >= kScaleBytes - 1);
    SeriesScale scale;
    scale.offset = reader.get<double>();
    scale.divisor = reader.get<double>();
    scale.scale = reader.get<double>();
    scale.by = reader.get<std::int8_t>();
    require_whole(scale.by >= -1 && scale.by < int(before.size()));
    require_whole(scale.by < 0 || before[std::size_t(scale.by)]);
    return scale;
}

// The values of series with scales.
std::vector<float> unpack_scaled(std::span<const std::byte> bytes, std::size_t count) {
    ByteReader reader(bytes);
    require_whole(!bytes.empty());
    const std::size_t series = reader.get<std::uint8_t>();
    require_whole(series > 0 && series <= kMostSeries && count % series == 0);
    std::vector<std::optional<SeriesScale>> scales;
    for (std::size_t n = 0; n < series; ++n) scales.push_back(read_scale(reader, scales));
    require_whole(reader.rest().size() == 4 * count);
    const Numbers all = numbers_in(reader.rest());
    const std::size_t steps = count / series;
    std::vector<Numbers> known;
    std::vector<float> values;
    values.reserve(count);
    for (std::size_t n = 0; n < series; ++n) {
        const auto begin = all.begin() + std::ptrdiff_t(n * steps);
        known.emplace_back(begin, begin + std::ptrdiff_t(steps));
        for (std::size_t at = 0; at < steps; ++at)
            values.push_back(scales[n] ? value_of(*scales[n], known[n][at], divisor_of(*scales[n], known, at))
                                       : std::bit_cast<float>(known[n][at]));
    }
    return values;
}

}  // namespace

bool begins_packed(std::string_view text) {
    constexpr char kZlib = 0x78;
    if (text.starts_with(kWithScales)) text.remove_prefix(1);
    return text.starts_with(kZlib);
}

std::string pack_series(std::span<const float> values, std::span<const SeriesScale> scales) {
    if (scales.empty()) return deflated(planes_of(std::vector<Numbers>{bits_of(values)}));
    assert(scales.size() <= kMostSeries && values.size() % scales.size() == 0);
    ByteWriter writer;
    const std::size_t steps = values.size() / scales.size();
    std::vector<Numbers> known, stored;
    writer.put(std::uint8_t(scales.size()));
    for (std::size_t n = 0; n < scales.size(); ++n) {
        assert(scales[n].by >= -1 && scales[n].by < int(n));
        const std::span<const float> series = values.subspan(n * steps, steps);
        std::optional<Numbers> numbers = whole_numbers(series, scales[n], known);
        known.push_back(numbers.value_or(Numbers()));
        stored.push_back(numbers ? *numbers : bits_of(series));
        writer.put(std::uint8_t(numbers.has_value()));
        if (!numbers) continue;
        writer.put(std::array{scales[n].offset, scales[n].divisor, scales[n].scale});
        writer.put(std::int8_t(scales[n].by));
    }
    writer.put_bytes(planes_of(stored));
    return kWithScales + deflated(writer.bytes());
}

std::vector<float> unpack_series(std::string_view packed, std::size_t count) {
    if (4 * count > kMostUnpacked * packed.size() + 64)
        throw Error(ErrorCode::io, "packed series are shorter than their number of values allows");
    if (packed.starts_with(kWithScales))
        return unpack_scaled(inflated(packed.substr(1), 1 + kMostSeries * kScaleBytes + 4 * count), count);
    const std::vector<std::byte> planes = inflated(packed, 4 * count);
    require_whole(planes.size() == 4 * count);
    std::vector<float> values;
    for (const std::uint32_t bits : numbers_in(planes)) values.push_back(std::bit_cast<float>(bits));
    return values;
}

}  // namespace nephos
