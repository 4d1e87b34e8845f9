// SPDX-License-Identifier: Apache-2.0
// Random damage to valid scenes and options: the outcome is always a Scene or a SceneErrors, never anything
// else.

#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

std::string content(const std::string& path) {
    std::ifstream file(std::string(NEPHOS_SOURCE_DIR) + "/" + path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

// What parsers stumble over.
const std::vector<std::string> kTokens{"[",
                                       "]",
                                       "{",
                                       "}",
                                       "[[",
                                       "]]",
                                       "\"",
                                       "'",
                                       "\"\"\"",
                                       "'''",
                                       "\\",
                                       "\\u",
                                       "\\UFFFFFFFF",
                                       "\\xe9",
                                       "=",
                                       ".",
                                       ",",
                                       "#",
                                       "\n",
                                       "\r",
                                       "\r\n",
                                       "\t",
                                       " ",
                                       "inf",
                                       "-inf",
                                       "nan",
                                       "+nan",
                                       "1e999",
                                       "-0",
                                       "0x",
                                       "0o7",
                                       "0b1",
                                       "1_000",
                                       "__",
                                       "1.",
                                       ".5",
                                       "9223372036854775807",
                                       "9223372036854775808",
                                       "-9223372036854775808",
                                       "true",
                                       "1979-05-27T07:32:00Z",
                                       "07:32:00",
                                       "2000-02-30",
                                       "\xEF\xBB\xBF",
                                       "\xC3",
                                       "\xED\xA0\x80",
                                       "\xF4\x90\x80\x80",
                                       "\xE2\x80\xAE",
                                       "\x1b[31m",
                                       std::string(1, '\0'),
                                       "a.b.c.d = 1\n",
                                       "[lattice]\n",
                                       "[[wind]]\n",
                                       "wind = 1\n",
                                       "levels = []",
                                       "{}",
                                       "[]",
                                       "[[[[[[[[",
                                       "{a={a={a={a="};

class Damage {
  public:
    explicit Damage(unsigned seed) : random_(seed) {}

    std::string to(std::string text) {
        for (int edits = number(1, 4); edits > 0; --edits) edit(text);
        return text;
    }
    int number(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

  private:
    std::size_t place(const std::string& text) { return std::size_t(number(0, int(text.size()))); }

    void edit(std::string& text) {
        const std::size_t at = place(text);
        const std::size_t length = std::min(std::size_t(number(1, 30)), text.size() - at);
        switch (number(0, 5)) {
            case 0:
                text.insert(at, 1, char(number(0, 255)));
                break;
            case 1:
                text.erase(at, length);
                break;
            case 2:
                text.insert(at, kTokens[std::size_t(number(0, int(kTokens.size()) - 1))]);
                break;
            case 3:
                text.insert(place(text), text.substr(at, length));
                break;
            case 4:
                text.replace(at, length, kTokens[std::size_t(number(0, int(kTokens.size()) - 1))]);
                break;
            default:
                if (at < text.size()) text[at] = char(text[at] ^ (1 << number(0, 7)));
        }
    }

    std::mt19937 random_;
};

struct Outcomes {
    int scenes = 0, errors = 0;
};

void read_damaged(const std::string& text, const std::vector<std::string>& options, Outcomes& outcomes) {
    try {
        const Scene scene = read_scene_text(text, "damaged.toml", {}, options);
        ++outcomes.scenes;
        EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene) << text;
    } catch (const SceneErrors& errors) {
        ++outcomes.errors;
        EXPECT_FALSE(errors.problems().empty());
        for (const Problem& problem : errors.problems()) {
            EXPECT_FALSE(problem.message.empty());
            EXPECT_EQ(problem.source_line.find('\n'), std::string::npos) << text;
            EXPECT_EQ(problem.source_line.find('\x1b'), std::string::npos) << text;
            EXPECT_LE(problem.source_line.size(), 1000u);
        }
    } catch (const std::exception& error) {
        ADD_FAILURE() << "neither a scene nor its errors but: " << error.what() << "\nfor:\n" << text;
    }
}

TEST(Mutation, DamagedScenesAreScenesOrErrors) {
    constexpr int kRounds = 1500;
    for (const char* name :
         {"scenes/cumulus.toml", "scenes/cumulus-by-hand.toml", "tests/scenes/bad/wind_forms.toml",
          "tests/scenes/bad/utf8.toml", "tests/scenes/bad/wrong_types.toml", "tests/golden/climate.toml"}) {
        SCOPED_TRACE(name);
        const std::string text = content(name);
        ASSERT_FALSE(text.empty());
        Outcomes outcomes;
        for (unsigned seed = 0; seed < kRounds && !testing::Test::HasFailure(); ++seed) {
            SCOPED_TRACE("seed " + std::to_string(seed));
            read_damaged(Damage(seed).to(text), {}, outcomes);
        }
        EXPECT_GT(outcomes.errors, kRounds / 10);
        if (std::string(name).starts_with("scenes/")) {
            EXPECT_GT(outcomes.scenes, kRounds / 20) << "some survive, in comments";
        }
    }
}

TEST(Mutation, DamagedOptionsAreScenesOrErrors) {
    const std::vector<std::string> options{"density.half=true", "wind[0].levels[1].height_m=1800",
                                           "lattice.initial=empty", "sun.colour=[1, 0.5, 0.25]",
                                           "field.scatters=[{count = 3, centre = {hum = 0.2}}]"};
    const std::string text = content("scenes/cumulus.toml");
    Outcomes outcomes;
    for (unsigned seed = 0; seed < 4000 && !testing::Test::HasFailure(); ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        read_damaged(text, {Damage(seed).to(options[seed % options.size()])}, outcomes);
    }
    EXPECT_GT(outcomes.errors, 400);
    EXPECT_GT(outcomes.scenes, 40);
}

}  // namespace
}  // namespace nephos
