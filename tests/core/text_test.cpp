// SPDX-License-Identifier: Apache-2.0
// Text from strangers is shown and never obeyed by a terminal.

#include "core/text.h"

#include <gtest/gtest.h>

namespace nephos {
namespace {

using namespace std::string_literals;

TEST(Escaped, PlainTextStaysAsItIs) {
    for (const std::string text : {"", "cumulus_0001.vdb", "Wolke über Köln ☁ 雲", "C:\\x1b", "a\"b'c"}) {
        EXPECT_EQ(escaped(text), text);
    }
}

TEST(Escaped, ControlsAreWrittenAsTheirCodes) {
    EXPECT_EQ(escaped("a\x1b]0;title\x07z"), "a\\u001b]0;title\\u0007z");
    EXPECT_EQ(escaped("\0\r\n\t\x7f"s), "\\u0000\\u000d\\u000a\\u0009\\u007f");
    EXPECT_EQ(escaped("\xC2\x9B"
                      "2J"),
              "\\u009b2J");  // CSI as UTF-8
    EXPECT_EQ(escaped("\xE2\x80\xAE"
                      "fdp.exe"),
              "\\u202efdp.exe");  // right-to-left override
}

// A terminal of eight bits takes 0x9B for CSI.
TEST(Escaped, BytesThatAreNoUtf8AreWrittenAsBytes) {
    EXPECT_EQ(escaped("\x9b"
                      "2J"),
              "\\x9b2J");
    EXPECT_EQ(escaped("K\xF6ln"), "K\\xf6ln");
    EXPECT_EQ(escaped("\xC2"), "\\xc2");
    EXPECT_EQ(escaped("\xC1\x9B"), "\\xc1\\x9b");  // overlong
}

TEST(Escaped, KeepsTheControlsThatAreNamed) {
    EXPECT_EQ(escaped("a\n\tb\r\x1b", "\n\t"), "a\n\tb\\u000d\\u001b");
}

// Every code below U+0100, and every single byte: nothing of the result is a control.
TEST(Escaped, LeavesNoControl) {
    for (int code = 0; code < 256; ++code) {
        const std::string byte(1, char(code));
        const std::string utf8 =
            code < 0x80 ? byte : std::string{char(0xC0 | code >> 6), char(0x80 | (code & 0x3F))};
        for (const std::string& text : {byte, utf8}) {
            const std::string shown = escaped(text);
            for (std::size_t at = 0; at < shown.size();) {
                const Character character = character_at(shown, at);
                EXPECT_TRUE(character.valid) << code;
                EXPECT_FALSE(is_terminal_control(character.code)) << code;
                at += character.bytes.size();
            }
        }
    }
}

TEST(ShellWord, IsReadByAShellAsTheText) {
    EXPECT_EQ(shell_word("a.b[0]=1"), "'a.b[0]=1'");
    EXPECT_EQ(shell_word("out/run-1"), "out/run-1");
    EXPECT_EQ(shell_word("my clouds"), "'my clouds'");
    EXPECT_EQ(shell_word("it's $HOME"), "'it'\\''s $HOME'");
    EXPECT_EQ(shell_word(""), "''");
}

}  // namespace
}  // namespace nephos
