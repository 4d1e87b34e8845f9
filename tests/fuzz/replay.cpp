// SPDX-License-Identifier: Apache-2.0
// TARGET [--mutations N] FILE|FOLDER...: calls a target with each file and with N damaged copies of it, the same at each
// call: a run of the targets where there is no libFuzzer. Prints how many inputs there were; a fault ends it by a signal. Fails
// with status 1 and the name of each whole file that no reader of the target accepts: damage to it would be found at the same
// place as the fault that it has. Only files below a folder `inputs` are held to that: scenes may need others beside them.

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "tests/fuzz/target.h"

namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// Files in the order of their names, at any depth.
std::vector<fs::path> files_in(const fs::path& path) {
    if (fs::is_regular_file(path)) return {path};
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path)) {
        if (entry.is_regular_file()) files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
}

// One to four damages: bits, numbers that readers stumble over, a cut, or a piece that stands twice.
std::string damaged(std::string bytes, std::mt19937& random) {
    constexpr std::uint64_t kNumbers[] = {0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, ~std::uint64_t(0)};
    for (unsigned left = 1 + random() % 4; left > 0 && !bytes.empty(); --left) {
        const std::size_t at = random() % bytes.size();
        switch (random() % 5) {
            case 0: bytes[at] = char(bytes[at] ^ (1 << random() % 8)); break;
            case 1: bytes[at] = char(random()); break;
            case 2: {
                const std::uint64_t number = kNumbers[random() % std::size(kNumbers)];
                const std::size_t width = std::min<std::size_t>(std::size_t(1) << random() % 4, bytes.size() - at);
                std::memcpy(bytes.data() + at, &number, width);
                break;
            }
            case 3: bytes.resize(at); break;
            default: bytes.insert(random() % bytes.size(), bytes.substr(at, random() % 64));
        }
    }
    return bytes;
}

void call(const std::string& bytes) {
    // A copy without room behind it, so that memory checkers see a read beyond the end.
    const std::vector<std::uint8_t> exact(bytes.begin(), bytes.end());
    LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

}  // namespace

int main(int count, char** arguments) {
    unsigned mutations = 0;
    std::size_t inputs = 0, refused = 0;
    for (int n = 1; n < count; ++n) {
        if (std::strcmp(arguments[n], "--mutations") == 0 && n + 1 < count) {
            mutations = unsigned(std::strtoul(arguments[++n], nullptr, 10));
            continue;
        }
        for (const fs::path& path : files_in(arguments[n])) {
            const std::string bytes = content(path);
            nephos::fuzz::accepted = 0;
            call(bytes);
            if (nephos::fuzz::accepted == 0 && path.string().find("/inputs/") != std::string::npos) {
                std::fprintf(stderr, "%s: no reader accepts it\n", path.c_str());
                ++refused;
            }
            std::mt19937 random(unsigned(bytes.size()));
            for (unsigned m = 0; m < mutations; ++m) call(damaged(bytes, random));
            inputs += 1 + mutations;
        }
    }
    std::printf("%zu inputs\n", inputs);
    return inputs == 0 ? 2 : refused > 0 ? 1 : 0;
}
