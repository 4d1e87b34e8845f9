// SPDX-License-Identifier: Apache-2.0
// Edits of scene texts: what is not edited keeps its bytes, what is edited reads back as it was set.

#include "scenes/format/toml_edit.h"

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include "core/error.h"
#include "scenes/format/document.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream out;
    out << file.rdbuf();
    return out.str();
}

std::vector<fs::path> shipped_scenes() {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(NEPHOS_SOURCE_DIR) / "scenes")) {
        if (entry.path().extension() == ".toml") paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
}

// Paths of all values, of all tables and elements, and of all arrays of tables.
struct Paths {
    std::vector<TextPath> values, tables, arrays;
};

void collect(const TomlNode& node, TextPath& path, Paths& out) {
    if (node.form == TomlNode::Form::value) out.values.push_back(path);
    if (node.is_table() && !path.empty()) out.tables.push_back(path);
    const bool of_tables = !node.items.empty() && node.items.front().is_table();
    if (node.form == TomlNode::Form::sections || of_tables) out.arrays.push_back(path);
    for (const auto& [name, entry] : node.entries) {
        path.push_back({name, 0});
        collect(entry, path, out);
        path.pop_back();
    }
    for (std::size_t n = 0; n < node.items.size(); ++n) {
        path.push_back({{}, n});
        collect(node.items[n], path, out);
        path.pop_back();
    }
}

Paths paths_of(const std::string& text) {
    Paths out;
    TextPath path;
    collect(toml_tree(text), path, out);
    return out;
}

std::string value_at(const std::string& text, const TextPath& path) {
    const TomlNode root = toml_tree(text);
    const TomlNode* node = find_node(root, path);
    if (node == nullptr) return "(missing)";
    return text.substr(node->value.begin, node->value.end - node->value.begin);
}

testing::AssertionResult is_toml(const std::string& text) {
    Document document;
    const int origin = document.add_origin("text", text, true);
    if (document.parse(origin)) return testing::AssertionSuccess();
    return testing::AssertionFailure() << format(document.problems) << text;
}

TEST(TomlEdit, NumbersThatStayAreWrittenAsTheyWere) {
    const std::string text = "a = [1.0e3, -3_200.5, 2] # place\nb = 1.50\nc = 0x2A\n";
    EXPECT_EQ(with_value(text, text_path("a"), "[1000, -3200.5, 5]"),
              "a = [1.0e3, -3_200.5, 5] # place\nb = 1.50\nc = 0x2A\n");
    EXPECT_EQ(with_value(text, text_path("b"), "1.5"), text);
    EXPECT_EQ(with_value(text, text_path("b"), "1.25"),
              "a = [1.0e3, -3_200.5, 2] # place\nb = 1.25\nc = 0x2A\n");
    EXPECT_EQ(with_value("z = 0.0", text_path("z"), "-0.0"), "z = -0.0");
    EXPECT_EQ(with_value("z = 1.0 # no integer", text_path("z"), "1", NumberForm::integer),
              "z = 1 # no integer");
    EXPECT_EQ(with_value("z = [1.0, 2_000, 3]", text_path("z"), "[1, 2000, 4]", NumberForm::integer),
              "z = [1, 2_000, 4]");
    EXPECT_EQ(with_value("z = [0xfe, 0o17, 0b1_1, 0x1F, 7]", text_path("z"), "[254, 15, 3, 32, 8]",
                         NumberForm::integer),
              "z = [0xfe, 0o17, 0b1_1, 32, 8]");
    EXPECT_EQ(with_value("z = [0x10, 2]", text_path("z"), "[16, 2, 5]"), "z = [0x10, 2, 5]");
    EXPECT_EQ(with_value("z = 0x20000000000001", text_path("z"), "9007199254740993"), "z = 9007199254740993");
    EXPECT_EQ(with_value("z = 9007199254740993", text_path("z"), "9007199254740992"), "z = 9007199254740992");
}

TEST(TomlEdit, ItemsOfAnArrayComeAndGoBesideComments) {
    const std::string text = "skies = [\n    \"few\", # of few\n    \"many\", # of many\n    \"rain\",\n]\n";
    const TextPath path = text_path("skies");
    const std::string few = "    \"few\", # of few\n", many = "    \"many\", # of many\n",
                      rain = "    \"rain\",\n";
    const auto of = [](const std::string& lines) { return "skies = [\n" + lines + "]\n"; };
    ASSERT_EQ(of(few + many + rain), text);
    EXPECT_EQ(with_value(text, path, R"(["few", "many", "new", "rain"])"),
              of(few + many + "    \"new\",\n" + rain));
    EXPECT_EQ(with_value(text, path, R"(["new", "few", "many", "rain"])"),
              of("    \"new\",\n" + few + many + rain));
    EXPECT_EQ(with_value(text, path, R"(["a", "b", "few", "c", "d", "rain", "e"])"),
              of("    \"a\",\n    \"b\",\n" + few + "    \"c\",\n    \"d\",\n" + rain + "    \"e\",\n"));
    EXPECT_EQ(with_value(text, path, R"(["few", "rain"])"), of(few + rain));
    EXPECT_EQ(with_value(of(few + rain), path, R"(["few", "many", "rain"])"),
              of(few + "    \"many\",\n" + rain));
    EXPECT_EQ(with_value(text, path, R"(["many"])"), of(many));
    EXPECT_EQ(with_value(text, path, "[]"), of(""));
    EXPECT_EQ(with_value("skies = [ # none\n]\n", path, R"(["few", "rain"])"),
              "skies = [\"few\", \"rain\" # none\n]\n");
    EXPECT_EQ(with_value("skies = [\n  1, # one\n  2 # two\n]\n", path, "[1, 2, 3]"),
              "skies = [\n  1, # one\n  2, # two\n  3\n]\n");
    EXPECT_EQ(with_value("skies = [1, 2]", path, "[0, 1, 3, 2, 4]"), "skies = [0, 1, 3, 2, 4]");
    EXPECT_EQ(with_value(text, path, "[\"x\", \"y\"]"), "skies = [\"x\", \"y\"]\n");
}

TEST(TomlEdit, SettingWhatIsThereChangesNoByte) {
    for (const fs::path& path : shipped_scenes()) {
        SCOPED_TRACE(path.string());
        const std::string text = content(path);
        const Paths paths = paths_of(text);
        EXPECT_GT(paths.values.size(), 5u);
        for (const TextPath& value : paths.values) {
            ASSERT_EQ(with_value(text, value, value_at(text, value)), text) << path_text(value);
        }
    }
}

// The parser and the tree see the same document: same tables, same arrays, values at the same places.
void expect_same(const Node& parsed, const TomlNode& tree, const std::string& where, std::string_view text) {
    SCOPED_TRACE(where);
    if (parsed.kind == Node::Kind::table) {
        ASSERT_TRUE(tree.is_table());
        ASSERT_EQ(parsed.entries.size(), tree.entries.size());
        for (const Entry& entry : parsed.entries) {
            const TomlNode* found = tree.find(entry.name);
            ASSERT_NE(found, nullptr) << entry.name;
            expect_same(entry.value, *found, where + "." + entry.name, text);
        }
    } else if (parsed.kind == Node::Kind::array) {
        ASSERT_EQ(parsed.items.size(), tree.items.size());
        for (std::size_t n = 0; n < parsed.items.size(); ++n) {
            expect_same(parsed.items[n], tree.items[n], where + "[" + std::to_string(n) + "]", text);
        }
    } else {
        ASSERT_EQ(tree.form, TomlNode::Form::value);
        const auto lines = std::count(text.begin(), text.begin() + std::ptrdiff_t(tree.value.begin), '\n');
        EXPECT_EQ(int(lines) + 1, parsed.place.line);
    }
}

TEST(TomlEdit, TreeAgreesWithTheParser) {
    std::vector<std::string> texts;
    for (const fs::path& path : shipped_scenes()) texts.push_back(content(path));
    texts.push_back(
        "a.b.c = 1\na.b.d = [ [1, 2], [3] ] # c\n\"q k\" = '''x\n[no]\n'''\n[t]\nx = { y.z = 1, w = {} }\n"
        "[[l]]\n[[l.m]]\nk = \"\\\"]\"\n[[l.m]]\n[l.n]\no = 07:32:00\n[[l]]\n");
    for (const std::string& text : texts) {
        Document document;
        const int origin = document.add_origin("text", text, true);
        const auto parsed = document.parse(origin);
        ASSERT_TRUE(parsed) << format(document.problems);
        expect_same(*parsed, toml_tree(text), "", text);
    }
}

// A tree of text that is no TOML ends where that does; indented lines once went on for ever.
TEST(TomlEdit, TreeOfOtherTextEndsAtTheError) {
    for (const char* rest : {" b", "  b c = 1\n", "\t[", "b", "= 1", " \"x", "[[", "c = [1, 2", "d = { e"}) {
        const TomlNode root = toml_tree(std::string("a = 1\n") + rest);
        ASSERT_NE(root.find("a"), nullptr) << rest;
        EXPECT_EQ(root.find("b"), nullptr) << rest;
    }
}

TEST(TomlEdit, OneValueChangesAlone) {
    const std::string text = "# top\n\n[sun]   # the sun\nelevation_deg = 40.0 # degrees\nazimuth_deg=1\n";
    EXPECT_EQ(with_value(text, text_path("sun.elevation_deg"), "12"),
              "# top\n\n[sun]   # the sun\nelevation_deg = 12 # degrees\nazimuth_deg=1\n");
    const std::string colours = "c = [ 1.0, # red\n  0.96,\n  0.90 ]\n";
    EXPECT_EQ(with_value(colours, text_path("c"), "[1.0, 0.5, 0.90]"),
              "c = [ 1.0, # red\n  0.5,\n  0.90 ]\n");
    EXPECT_EQ(with_value(colours, text_path("c[2]"), "1"), "c = [ 1.0, # red\n  0.96,\n  1 ]\n");
    EXPECT_EQ(with_value(colours, text_path("c"), "3"), "c = 3\n");
}

TEST(TomlEdit, MissingKeysFindTheirTable) {
    EXPECT_EQ(with_value("", text_path("seed"), "7"), "seed = 7\n");
    EXPECT_EQ(with_value("", text_path("sun.elevation_deg"), "7"), "[sun]\nelevation_deg = 7\n");
    EXPECT_EQ(with_value("# file\n\n[sun]\n", text_path("seed"), "7"), "# file\nseed = 7\n\n[sun]\n");
    EXPECT_EQ(with_value("name = \"a\"\n[sun]\n  x = 1\n\n# on y\n[y]\n", text_path("sun.z"), "2"),
              "name = \"a\"\n[sun]\n  x = 1\n  z = 2\n\n# on y\n[y]\n");
    EXPECT_EQ(with_value("[sun]\r\nx = 1", text_path("sun.z"), "2"), "[sun]\r\nx = 1\r\nz = 2\r\n");
    EXPECT_EQ(with_value("[field.background]\next = 1\n", text_path("field.initial"), "\"field\""),
              "[field]\ninitial = \"field\"\n\n[field.background]\next = 1\n");
    const std::string layer = "[[layer]]\nname = \"a\"\nlattice = { cells = [1, 2, 3] }\n";
    const std::string with_rain = with_value(layer, text_path("layer[0].rain.find"), "true");
    EXPECT_EQ(with_rain, layer + "rain.find = true\n");
    EXPECT_EQ(with_value(with_rain, text_path("layer[0].rain.finder.mm"), "1"),
              layer + "rain.find = true\nrain.finder.mm = 1\n");
    EXPECT_EQ(with_value(layer, text_path("layer[0].lattice.cell_size_m"), "80"),
              "[[layer]]\nname = \"a\"\nlattice = { cells = [1, 2, 3], cell_size_m = 80 }\n");
    EXPECT_EQ(with_value("a = {}\n", text_path("a.b"), "1"), "a = { b = 1 }\n");
    EXPECT_THROW(with_value(layer, text_path("layer[1].name"), "1"), Error);
    EXPECT_THROW(with_value(layer, text_path("layer[0].name.x"), "1"), Error);
    EXPECT_THROW(with_value(layer, text_path("layer"), "1"), Error);
}

TEST(TomlEdit, RemovesWhatBelongsToItAndNoMore) {
    const std::string text =
        "# file\na = 1 # one\nb = 2\n\n# The first.\n[[m]]\nn = 1\n[m.k]\nx = 1\n\n# Both:\n\n# The "
        "second.\n[[m]]\nn = 2\n";
    EXPECT_EQ(without(text, text_path("a")), text.substr(0, 7) + text.substr(text.find("b = 2")));
    EXPECT_EQ(without(text, text_path("m[0]")),
              "# file\na = 1 # one\nb = 2\n\n# Both:\n\n# The second.\n[[m]]\nn = 2\n");
    EXPECT_EQ(without(text, text_path("m[1]")),
              "# file\na = 1 # one\nb = 2\n\n# The first.\n[[m]]\nn = 1\n[m.k]\nx = 1\n\n# Both:\n");
    EXPECT_EQ(without(text, text_path("nothing.here")), text);
    const std::string list =
        "l = [\n    { a = 1 }, # first\n    { a = 2 },\n]\nk = [1, 2, 3]\nt = { a = 1, b = 2 }\n";
    EXPECT_EQ(without(list, text_path("l[0]")),
              "l = [\n    { a = 2 },\n]\nk = [1, 2, 3]\nt = { a = 1, b = 2 }\n");
    EXPECT_EQ(without("k = [1, 2, 3]\n", text_path("k[2]")), "k = [1, 2]\n");
    EXPECT_EQ(without("k = [1, 2, 3]\n", text_path("k[0]")), "k = [2, 3]\n");
    EXPECT_EQ(without("k = [1]\n", text_path("k[0]")), "k = []\n");
    EXPECT_EQ(without("t = { a = 1, b = 2 }\n", text_path("t.a")), "t = { b = 2 }\n");
    EXPECT_EQ(without("t = { a = 1, b = 2 }\n", text_path("t.b")), "t = { a = 1 }\n");
}

TEST(TomlEdit, ElementsAreAddedInTheFormOfTheOthers) {
    const std::vector<TextEntry> entries{{"name", "\"b\""}, {"state", "0.5"}};
    EXPECT_EQ(with_new_element("", text_path("sky"), entries), "[[sky]]\nname = \"b\"\nstate = 0.5\n");
    EXPECT_EQ(with_new_element("[[sky]]\nname = \"a\"\n\n[sun]\nx = 1\n", text_path("sky"), entries),
              "[[sky]]\nname = \"a\"\n\n[[sky]]\nname = \"b\"\nstate = 0.5\n\n[sun]\nx = 1\n");
    EXPECT_EQ(with_new_element("sky = [\n  { name = \"a\" }, # x\n]\n", text_path("sky"), entries),
              "sky = [\n  { name = \"a\" }, # x\n  { name = \"b\", state = 0.5 },\n]\n");
    EXPECT_EQ(with_new_element("sky = [{ name = \"a\" }]\n", text_path("sky"), entries),
              "sky = [{ name = \"a\" }, { name = \"b\", state = 0.5 }]\n");
    EXPECT_EQ(with_new_element("sky = []\n", text_path("sky"), entries),
              "sky = [{ name = \"b\", state = 0.5 }]\n");
    EXPECT_EQ(with_new_element("l = { a = 1 }\n", text_path("l.sky"), entries),
              "l = { a = 1, sky = [{ name = \"b\", state = 0.5 }] }\n");
    EXPECT_EQ(with_new_element("[[l]]\na = 1\n[l.b]\n\n[[l]]\n", text_path("l[0].c.d"), entries),
              "[[l]]\na = 1\n[l.b]\n\n[[l.c.d]]\nname = \"b\"\nstate = 0.5\n\n[[l]]\n");
    EXPECT_EQ(with_copied_element("# first\n[[l]]\na = 1\n[l.b]\nc = 2\n\n[[l]]\na = 2", text_path("l"), 0),
              "# first\n[[l]]\na = 1\n[l.b]\nc = 2\n\n[[l]]\na = 1\n[l.b]\nc = 2\n\n[[l]]\na = 2");
    EXPECT_EQ(with_copied_element("s = [\n  { a = 1 },\n  { a = 2 }\n]\n", text_path("s"), 1),
              "s = [\n  { a = 1 },\n  { a = 2 },\n  { a = 2 }\n]\n");
}

// Any sequence of edits leaves TOML in which the last value set reads back.
TEST(TomlEdit, RandomEditsStayToml) {
    const unsigned seed = 20261122;
    std::mt19937 random(seed);
    const auto pick = [&](std::size_t count) { return std::size_t(random()) % count; };
    for (const fs::path& path : shipped_scenes()) {
        SCOPED_TRACE(path.string() + ", seed " + std::to_string(seed));
        std::string text = content(path);
        for (int n = 0; n < 120 && text.size() < 100'000; ++n) {
            const Paths paths = paths_of(text);
            const std::string before = text;
            std::string what;
            const std::size_t kind = pick(8);
            if (kind < 3 && !paths.values.empty()) {
                const TextPath& to = paths.values[pick(paths.values.size())];
                what = "set " + path_text(to);
                text = with_value(text, to, std::to_string(random()));
            } else if (kind < 4 && !paths.tables.empty()) {
                TextPath to = paths.tables[pick(paths.tables.size())];
                to.push_back({"new_" + std::to_string(n), 0});
                what = "add " + path_text(to);
                text = with_value(text, to, std::to_string(n));
                EXPECT_EQ(value_at(text, to), std::to_string(n)) << what;
            } else if (kind < 5 && !paths.values.empty()) {
                const TextPath& to = paths.values[pick(paths.values.size())];
                what = "remove " + path_text(to);
                text = without(text, to);
            } else if (kind < 6 && paths.tables.size() > 6) {
                const TextPath& to = paths.tables[pick(paths.tables.size())];
                what = "remove table " + path_text(to);
                text = without(text, to);
            } else if (!paths.arrays.empty()) {
                const TextPath& to = paths.arrays[pick(paths.arrays.size())];
                what = "element of " + path_text(to);
                const std::size_t count = find_node(toml_tree(text), to)->items.size();
                text = kind == 6 || count == 0
                           ? with_new_element(text, to, std::vector<TextEntry>{{"k", "1"}})
                           : with_copied_element(text, to, pick(count));
                EXPECT_EQ(find_node(toml_tree(text), to)->items.size(), count + 1) << what;
            }
            ASSERT_TRUE(is_toml(text)) << what << "\nbefore:\n" << before;
        }
    }
}

TEST(TomlEdit, PathsAreReadAndWritten) {
    for (const char* path : {"a", "a.b", "wind[0].levels[12].height_m", "a[0][1]"}) {
        EXPECT_EQ(path_text(text_path(path)), path);
    }
    for (const char* path : {"", ".a", "a.", "a[", "a[]", "a[x]", "a[1", "a[1]b", "a..b"}) {
        EXPECT_THROW(text_path(path), Error) << path;
    }
}

// The comma of an element stands behind its comment, on another line.
TEST(TomlEdit, CommasBehindCommentsGoWithTheirElement) {
    const std::string list = "a = [\n  1 # one\n  , 2 # two\n  , 3\n]\n";
    EXPECT_EQ(without(list, text_path("a[0]")), "a = [\n   # one\n   2 # two\n  , 3\n]\n");
    EXPECT_EQ(without(list, text_path("a[1]")), "a = [\n  1 # one\n  ,  # two\n   3\n]\n");
    for (std::size_t n = 0; n < 3; ++n) {
        const std::string left = without(list, text_path("a[" + std::to_string(n) + "]"));
        EXPECT_TRUE(is_toml(left)) << left;
        EXPECT_EQ(find_node(toml_tree(left), text_path("a"))->items.size(), 2u) << left;
        const std::string copied = with_copied_element(list, text_path("a"), n);
        EXPECT_TRUE(is_toml(copied)) << copied;
        EXPECT_EQ(find_node(toml_tree(copied), text_path("a"))->items.size(), 4u) << copied;
        const std::string more =
            with_new_element(list, text_path("a"), std::vector<TextEntry>{{"k", "1"}}, n);
        EXPECT_TRUE(is_toml(more)) << more;
        EXPECT_EQ(find_node(toml_tree(more), text_path("a"))->items.size(), 4u) << more;
    }
}

// The last line of a text of several lines looks like the comment of the section below it.
TEST(TomlEdit, TheEndOfATextIsNoCommentOfASection) {
    const std::string text = "name = \"\"\"\n# x\"\"\"\n[time]\nsteps = 3\n";
    EXPECT_EQ(without(text, text_path("time")), text.substr(0, text.find("[time]")));
    const std::string below = "name = \"\"\"\n# x\"\"\"\n[time.b]\nsteps = 3\n";
    const std::string more = with_value(below, text_path("time.c"), "1");
    EXPECT_TRUE(is_toml(more)) << more;
    EXPECT_EQ(value_at(more, text_path("name")), value_at(below, text_path("name")));
}

TEST(TomlEdit, DottedKeysBetweenBracesAreRemovedTogether) {
    EXPECT_EQ(without("t = { b = 3, a.x = 1, a.y = 2 }\nc = 1\n", text_path("t.a")),
              "t = { b = 3 }\nc = 1\n");
    EXPECT_EQ(without("t = { a.x = 1, b = 3, a.y = 2 }\n", text_path("t.a")), "t = { b = 3 }\n");
    EXPECT_EQ(without("t = { a.x = 1, a.y = 2, b = 3 }\n", text_path("t.a")), "t = { b = 3 }\n");
    EXPECT_TRUE(is_toml(without("t = { a.x = 1, a.y = 2 }\n", text_path("t.a"))));
}

// The comma behind the last element must not be left alone.
TEST(TomlEdit, CommasBehindTheLastElementGoWithIt) {
    EXPECT_EQ(without("v = [1,]\n", text_path("v[0]")), "v = []\n");
    EXPECT_EQ(without("v = [1,\n  2,]\n", text_path("v[1]")), "v = [1,\n  ]\n");
    EXPECT_EQ(without("v = [1, 2,]\n", text_path("v[1]")), "v = [1,]\n");
    EXPECT_EQ(without("v = [{ x = 1 }, # c\n]\n", text_path("v[0]")), "v = [ # c\n]\n");
    EXPECT_EQ(without("v = [\n  { a = 1 },\n  { a = 2 }, ]\n", text_path("v[1]")),
              "v = [\n  { a = 1 },\n   ]\n");
}

TEST(TomlEdit, SectionsBelowDottedKeysBelongToTheirTable) {
    const std::string one = "[[layer]]\nrain.on = true\n[[layer.rain.placed]]\nx_m = 0\n",
                      two = "[[layer]]\nname = \"high\"\n";
    EXPECT_EQ(without(one + two, text_path("layer[0]")), two);
    EXPECT_EQ(without(one + two, text_path("layer[0].rain")), "[[layer]]\n" + two);
    for (const std::string& more :
         {with_copied_element(one + two, text_path("layer"), 0),
          with_new_element(one + two, text_path("layer"), std::vector<TextEntry>{{"k", "1"}}, 1)}) {
        ASSERT_TRUE(is_toml(more)) << more;
        const TomlNode tree = toml_tree(more);
        ASSERT_EQ(find_node(tree, text_path("layer"))->items.size(), 3u) << more;
        EXPECT_NE(find_node(tree, text_path("layer[0].rain.placed[0].x_m")), nullptr) << more;
        EXPECT_EQ(value_at(more, text_path("layer[2].name")), "\"high\"") << more;
    }
}

TEST(TomlEdit, ElementsAreAddedBeforeOthers) {
    const std::vector<TextEntry> entries{{"k", "1"}};
    const std::string sections =
        "# file\n\n[sun]\nx = 1\n# first\n[[sun.path]]  # a\nk = 2\n\n[[sun.path]]\nk = 3\n";
    EXPECT_EQ(with_new_element(sections, text_path("sun.path"), entries, 0),
              "# file\n\n[sun]\nx = 1\n[[sun.path]]\nk = 1\n\n# first\n[[sun.path]]  # a\nk = "
              "2\n\n[[sun.path]]\nk = 3\n");
    EXPECT_EQ(with_new_element(sections, text_path("sun.path"), entries, 1),
              "# file\n\n[sun]\nx = 1\n# first\n[[sun.path]]  # a\nk = 2\n\n[[sun.path]]\nk = "
              "1\n\n[[sun.path]]\nk = 3\n");
    EXPECT_EQ(with_new_element("a = [{ k = 2 }, { k = 3 }]\n", text_path("a"), entries, 0),
              "a = [{ k = 1 }, { k = 2 }, { k = 3 }]\n");
    EXPECT_EQ(with_new_element("a = [\n  # two\n  { k = 2 }, # b\n]\n", text_path("a"), entries, 0),
              "a = [\n  # two\n  { k = 1 },\n  { k = 2 }, # b\n]\n");
}

TEST(TomlEdit, KeysThatAreAddedToDottedOnesKeepTheirQuotes) {
    EXPECT_EQ(with_value("\"a b\".x = 1\n", {{"a b", 0}, {"n", 0}}, "2"), "\"a b\".x = 1\n\"a b\".n = 2\n");
}

}  // namespace
}  // namespace nephos
