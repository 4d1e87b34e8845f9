// SPDX-License-Identifier: Apache-2.0
// The stream under OpenVDB's writer: the bytes and positions of a string stream, whatever is written where.

#include "density/vdb/vdb_output.h"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <ostream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace nephos {
namespace {

class VdbOutputTest : public testing::Test {
  protected:
    VdbOutputTest() {
        std::string name = (std::filesystem::temp_directory_path() / "nephos-test-XXXXXX").string();
        if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
        folder_ = name;
    }
    ~VdbOutputTest() override {
        std::error_code ignored;
        std::filesystem::remove_all(folder_, ignored);
    }
    std::string content(const std::string& name) const {
        std::ifstream file(folder_ / name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(file), {});
    }
    std::filesystem::path folder_;
};

TEST_F(VdbOutputTest, WritesAsAStringStreamDoes) {
    std::ofstream(folder_ / "file") << "what was there before, which goes";
    VdbOutput file(folder_ / "file");
    ASSERT_EQ(file.error(), 0);
    std::ostream stream(&file);
    std::ostringstream expected;
    std::mt19937 random(7);
    for (int n = 0; n < 300; ++n) {
        const std::string piece(random() % (n % 50 == 0 ? 300000 : 900), char('a' + n % 26));
        stream << piece;
        expected << piece;
        ASSERT_EQ(stream.tellp(), expected.tellp());
        if (n % 7 == 0) {  // back, and forth again
            const auto end = stream.tellp();
            const auto place = std::streamoff(random() % (std::size_t(std::streamoff(end)) + 1));
            for (std::ostream* s : {&stream, static_cast<std::ostream*>(&expected)}) {
                s->seekp(place);
                (*s << 'X').seekp(end);
            }
        }
    }
    EXPECT_TRUE(stream.good());
    EXPECT_TRUE(file.close());
    EXPECT_EQ(content("file"), expected.str());
}

TEST_F(VdbOutputTest, OpensNoLink) {
    std::ofstream(folder_ / "victim") << "precious";
    std::filesystem::create_symlink("victim", folder_ / "link");
    VdbOutput file(folder_ / "link");
    EXPECT_EQ(file.error(), ELOOP);
    std::ostream(&file) << "new";
    EXPECT_FALSE(file.close());
    EXPECT_EQ(content("victim"), "precious");
}

TEST_F(VdbOutputTest, KeepsTheFirstError) {
    VdbOutput missing(folder_ / "missing");
    EXPECT_EQ(missing.error(), ENOENT);
    VdbOutput full("/dev/full");
    std::ostream stream(&full);
    stream << std::string(200000, 'x');
    EXPECT_TRUE(stream.bad());
    EXPECT_EQ(stream.tellp(), std::streampos(-1));
    EXPECT_EQ(full.error(), ENOSPC);
    EXPECT_FALSE(full.close());
    EXPECT_EQ(full.error(), ENOSPC);
}

}  // namespace
}  // namespace nephos
