// SPDX-License-Identifier: Apache-2.0
// Every scene in tests/scenes/bad has its messages beside it, NAME.txt for NAME.toml: what a user sees, to
// the letter. After a deliberate change of a message, run with NEPHOS_UPDATE_GOLDEN=1 and read the
// difference.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/text.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = fs::path(NEPHOS_SOURCE_DIR) / "tests/scenes/bad";

std::string content(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

std::vector<fs::path> bad_scenes() {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::directory_iterator(kFolder)) {
        if (entry.path().extension() == ".toml") paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
}

// The label is the bare file name, so that messages do not depend on where the checkout lies.
std::string messages_of(const fs::path& path) {
    try {
        read_scene_text(content(path), path.filename().string());
    } catch (const SceneErrors& errors) {
        EXPECT_EQ(errors.code(), ErrorCode::usage);
        return format(errors.problems());
    }
    return "no error\n";
}

TEST(BadScenes, MessagesAreTheExpectedOnes) {
    const bool update = std::getenv("NEPHOS_UPDATE_GOLDEN") != nullptr;
    const std::vector<fs::path> paths = bad_scenes();
    ASSERT_GE(paths.size(), 40u) << "the corpus is missing";
    for (const fs::path& path : paths) {
        SCOPED_TRACE(path.filename().string());
        fs::path golden = path;
        golden.replace_extension(".txt");
        const std::string messages = messages_of(path);
        EXPECT_NE(messages, "no error\n");
        if (update) std::ofstream(golden, std::ios::binary) << messages;
        EXPECT_EQ(messages, content(golden));
    }
}

// Every problem is found in one pass: as many as are in the file.
TEST(BadScenes, AllProblemsAreFoundInOnePass) {
    try {
        read_scene(kFolder / "wrong_types.toml");
        FAIL() << "no error";
    } catch (const SceneErrors& errors) {
        EXPECT_EQ(errors.problems().size(), 17u);
        int line = 0;
        for (const Problem& problem : errors.problems()) {
            EXPECT_GE(problem.where.line, line) << "in the order of the file";
            line = problem.where.line;
            EXPECT_FALSE(problem.source_line.empty());
            EXPECT_GT(problem.caret, 0);
        }
    }
}

TEST(BadScenes, FilesThatCannotBeReadAreInputErrors) {
    const auto code_of = [](const fs::path& path) {
        try {
            read_scene(path);
        } catch (const Error& error) {
            EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
            return error.code();
        }
        return ErrorCode::check;
    };
    EXPECT_EQ(code_of(kFolder / "no such file.toml"), ErrorCode::io);
    EXPECT_EQ(code_of(kFolder), ErrorCode::io);
    EXPECT_EQ(code_of("/dev/zero"), ErrorCode::usage) << "endless: refused at the size limit";
}

// 100 MB of valid TOML.
TEST(BadScenes, HugeFileIsRefusedForItsSize) {
    const fs::path path = fs::path(testing::TempDir()) / "nephos_huge_scene.toml";
    {
        std::ofstream file(path, std::ios::binary);
        const std::string block(1 << 20, '\n');
        for (int n = 0; n < 100; ++n) file << block;
    }
    try {
        read_scene(path);
        ADD_FAILURE();
    } catch (const SceneErrors& errors) {
        EXPECT_NE(std::string(errors.what()).find("is larger than"), std::string::npos) << errors.what();
    }
    fs::remove(path);
}

// In a line of many characters, of one byte and of more, the caret stands below what is meant.
TEST(BadScenes, PlacesInALongLineAreTheRightOnes) {
    std::string text = "sun = { ";
    for (int n = 0; n < 3000; ++n) {
        if (n > 0) text += ", ";
        const std::string number = std::to_string(n);
        text += (n % 3 == 0 ? "\"\u00e4\u96f2" : "\"key") + number + "\" = " + number;
    }
    try {
        read_scene_text(text + " }\n", "long.toml");
        FAIL();
    } catch (const SceneErrors& errors) {
        ASSERT_EQ(errors.problems().size(), 1001u);
        for (int n = 0; n < 1000; ++n) {
            const Problem& problem = errors.problems()[std::size_t(n)];
            std::size_t at = 0;
            for (int column = 1; column < problem.caret; ++column)
                at += character_at(problem.source_line, at).bytes.size();
            const std::string key = (n % 3 == 0 ? "\u00e4\u96f2" : "key") + std::to_string(n);
            EXPECT_EQ(problem.source_line.substr(at, key.size() + 2), "\"" + key + "\"")
                << problem.source_line;
            EXPECT_NE(problem.message.find("`" + key + "`"), std::string::npos) << problem.message;
            EXPECT_LT(problem.source_line.size(), 500u);
        }
    }
}

// The worst that fits into the size limit: messages stay bounded; what takes the square of the size would outlast the test.
TEST(BadScenes, WorstCasesOfTheAllowedSizeEnd) {
    const auto problems_of = [](const std::string& text) -> std::size_t {
        try {
            read_scene_text(text, "worst.toml");
        } catch (const SceneErrors& errors) {
            EXPECT_LT(std::string(errors.what()).size(), 2u << 20);
            return errors.problems().size();
        }
        return 0;
    };
    const auto repeated = [](const auto& line_of) {
        std::string text;
        for (int n = 0; text.size() < kMaxSceneBytes - 100; ++n) line_of(n, text);
        return text;
    };
    EXPECT_EQ(problems_of(repeated(
                  [](int n, std::string& out) { ((out += "key") += std::to_string(n)) += " = 1\n"; })),
              1001u);
    EXPECT_EQ(problems_of(repeated(
                  [](int n, std::string& out) { ((out += "a") += std::to_string(n)) += ".b = 1\n"; })),
              1u);
    EXPECT_EQ(problems_of("name = [" + repeated([](int, std::string& out) { out += "1,"; }) + "]\n"), 1u);
    EXPECT_EQ(problems_of(repeated([](int, std::string& out) { out += "[[a]]\n"; })), 1u);
    EXPECT_EQ(problems_of("name = \"" + std::string(kMaxSceneBytes - 100, 'x') + "\"\n"), 1u);
    EXPECT_EQ(problems_of("sun.elevation_deg = [" + std::string(kMaxSceneBytes - 100, '[')), 1u);
}

}  // namespace
}  // namespace nephos
