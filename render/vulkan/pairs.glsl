// SPDX-License-Identifier: Apache-2.0
// Numbers as sums of two floats, some 45 bits. Sums and products without loss: T. J. Dekker, "A floating-point technique for
// extending the available precision", 1971; D. E. Knuth, The Art of Computer Programming 2, 4.2.2.

struct Pair {
    float high, low;
};

Pair exact_sum(float a, float b) {
    precise float sum = a + b;
    precise float part = sum - a;
    precise float rest = (a - (sum - part)) + (b - part);
    return Pair(sum, rest);
}

// Upper and lower half of a number's bits.
Pair halves(float a) {
    precise float c = 4097.0 * a;
    precise float high = c - (c - a);
    precise float low = a - high;
    return Pair(high, low);
}

Pair exact_product(float a, float b) {
    Pair x = halves(a), y = halves(b);
    precise float product = a * b;
    precise float rest = ((x.high * y.high - product) + x.high * y.low + x.low * y.high) + x.low * y.low;
    return Pair(product, rest);
}
