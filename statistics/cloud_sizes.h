// SPDX-License-Identifier: Apache-2.0
#pragma once

// Distribution of cloud sizes, n(a) ~ a^-t, and the fractal dimension of cloud edges, gathered over many snapshots.
//
// Two estimates of t, for neither is right everywhere: near the percolation threshold (exact value 187/91 = 2.055) a box of
// 256 x 128 columns gives 1.94 +- 0.03, one of 1024 x 1024 about 2.00: the finite grid shifts both by 0.05 to 0.1, more
// than any error bar says.
//
//     line        least squares through log(n / width) of half-octave bins that hold at least 24 whole clouds, and no more
//                 that are cut by an open side (DeWitt and Garrett, Atmos. Chem. Phys. 24, 2024)
//     likelihood  maximum likelihood of a^-t / sum of a^-t over a1 <= a <= a2, whole numbers of columns
//                 (Clauset, Shalizi and Newman, SIAM Review 51, 2009, eq. B.8 with an upper end)
//
// Both use clouds of a1 = 36 columns (Lovejoy 1982: smaller ones show the grid) up to a2 = a fifth of the shorter side
// squared, and leave out those that are cut.

#include <array>
#include <cstdint>
#include <span>

#include "statistics/clouds.h"

namespace nephos {

// Bin n holds areas from 2^(n/2) to below 2^((n+1)/2) columns.
inline constexpr int kSizeBins = 64;
int size_bin(std::uint64_t area);
// Returns the smallest whole area of a bin; the bin is empty where it equals that of the next one.
std::uint64_t size_bin_begin(int bin);

// Range of areas, in columns, both ends included.
struct SizeRange {
    std::uint64_t first = 36, last = 0;
};
// Returns the range described above for a lattice; empty (last < first) where it is too small.
SizeRange default_size_range(const Extent& extent);

// An estimate with its standard error; NaN where there is too little to tell.
struct Estimate {
    double value, error;
};

// Sums over clouds. Adding one's sums to another's is adding its clouds.
class CloudSizes {
  public:
    explicit CloudSizes(SizeRange range) : range_(range) {}
    void add(std::span<const ConnectedCloud> clouds);
    void add(const CloudSizes& other);

    std::uint64_t clouds() const { return clouds_; }
    std::uint64_t area() const { return area_; }  // of all clouds, in columns
    const SizeRange& range() const { return range_; }
    // Number of clouds of a bin, and how many of them are cut: those count with the area that is inside.
    std::uint64_t count(int bin) const { return counts_[std::size_t(bin)]; }
    std::uint64_t count_cut(int bin) const { return cut_[std::size_t(bin)]; }

    // Return t by the two methods. The error of the line is that of the fit, of the likelihood from the Fisher information:
    // both take clouds as independent; spread between seeds says more.
    Estimate line_exponent() const;
    Estimate likelihood_exponent() const;
    // Returns D of edges ~ area^(D/2), least squares in logarithms over the clouds of the range.
    Estimate fractal_dimension() const;

  private:
    SizeRange range_;
    std::uint64_t clouds_ = 0, area_ = 0;
    std::array<std::uint64_t, kSizeBins> counts_{}, cut_{};
    // Over the whole clouds in the range: number, sums of log area and log edges and of their products.
    std::uint64_t in_range_ = 0;
    double log_area_ = 0, log_edges_ = 0, log_area_2_ = 0, log_product_ = 0, log_edges_2_ = 0;
};

}  // namespace nephos
