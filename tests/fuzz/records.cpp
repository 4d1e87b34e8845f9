// SPDX-License-Identifier: Apache-2.0
// Records of a sweep: lines as they are, and with the version and with the hash at the end of each made right; packed
// series with scales, deflated here so that damage comes to their header and not to zlib.

#include "study/records.h"

#include <cstring>
#include <fstream>

#include "study/packed_series.h"

#include "automaton/checkpoint.h"
#include "core/random.h"
#include "tests/fuzz/target.h"
#include "tests/study/hand_packed.h"

namespace {

using namespace nephos;

constexpr std::string_view kHashField = ",\"xxh3\":\"";

// The line with another number after a key.
std::string with_number(const std::string& line, std::string_view key, std::uint64_t number) {
    const std::size_t at = line.find(key);
    if (at == line.npos) return line;
    const std::size_t begin = at + key.size(), end = line.find_first_not_of("0123456789", begin);
    return line.substr(0, begin) + std::to_string(number) + (end == line.npos ? "" : line.substr(end));
}

// The line with the versions of this program's statistics and random stream, so that inputs outlive them.
std::string of_this_version(const std::string& line) {
    return with_number(with_number(line, "\"statistics_version\":", NEPHOS_STATISTICS_VERSION), "\"random_stream_version\":",
                       kRandomStreamVersion);
}

// Each line that has a hash, with the hash of what stands before it.
std::string sealed(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        const std::string_view line = text.substr(0, end);
        if (const std::size_t field = line.rfind(kHashField); field != line.npos) {
            const std::string body = of_this_version(std::string(line.substr(0, field)));
            out += body + std::string(kHashField) + hash_of_bytes(std::as_bytes(std::span(body))).hex() + "\"}";
        } else {
            out += line;
        }
        out += '\n';
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    return out;
}

// A folder with one shard: its lines, and a series of some values.
class Study {
  public:
    Study() {
        std::string name = (std::filesystem::temp_directory_path() / "nephos-fuzz-XXXXXX").string();
        fuzz::require(mkdtemp(name.data()) != nullptr, "mkdtemp");
        folder_ = name;
        std::filesystem::create_directory(folder_ / "shards");
        std::ofstream(folder_ / "shards/0000-of-0001.series") << std::string(4096, '\0');
    }
    ~Study() {
        std::error_code ignored;
        std::filesystem::remove_all(folder_, ignored);
    }
    void read(std::string_view lines) const {
        std::ofstream(folder_ / "shards/0000-of-0001.jsonl", std::ios::binary) << lines;
        fuzz::accepts([&] {
            const Records records = Records::read({folder_});
            if (!records.problems().empty()) throw Error(ErrorCode::io, records.problems().front());
            if (records.size() == 0) throw Error(ErrorCode::io, "no record");
        });
    }

  private:
    std::filesystem::path folder_;
};

// Two bytes with the number of values, and what is deflated.
void unpack(std::string_view bytes) {
    std::uint16_t count = 0;
    if (bytes.size() < sizeof(count)) return;
    std::memcpy(&count, bytes.data(), sizeof(count));
    const std::string packed = test::hand_packed(std::as_bytes(std::span(bytes.substr(sizeof(count)))));
    fuzz::accepts([&] {
        fuzz::require(unpack_series(packed, count).size() == count, "as many values as were asked for");
    });
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Study study;
    const std::string_view text = fuzz::as_text(data, size);
    study.read(text);
    study.read(sealed(text));
    unpack(text);
    return 0;
}
