// SPDX-License-Identifier: Apache-2.0
// The document of the editor: saving keeps bytes, undo goes back to them, problems leave the last good scene, changes
// on disk and crashes lose nothing.

#include "apps/editor/scene_document.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "apps/editor/schema_values.h"
#include "core/error.h"
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

// A folder of its own for each test.
struct Folder {
    Folder()
        : path(fs::path(testing::TempDir()) /
               ("editor_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
        fs::remove_all(path);
        fs::create_directories(path);
    }
    ~Folder() { fs::remove_all(path); }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    fs::path path;
};

void write(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
    // The clock of a file system may be coarse.
    fs::last_write_time(path, fs::last_write_time(path) + std::chrono::seconds(2));
}

TEST(SceneDocument, OpenAndSaveOfShippedScenesChangesNoByte) {
    const Folder folder;
    int count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(NEPHOS_SOURCE_DIR) / "scenes")) {
        if (entry.path().extension() != ".toml") continue;
        SceneDocument document(entry.path());
        EXPECT_TRUE(document.problems().empty()) << entry.path();
        ASSERT_TRUE(document.last_sound_scene()) << entry.path();
        EXPECT_EQ(*document.last_sound_scene(), read_scene(entry.path())) << entry.path();
        const fs::path copy = folder.path / entry.path().filename();
        document.save_as(copy);
        EXPECT_EQ(content(copy), content(entry.path())) << entry.path();
        EXPECT_FALSE(document.is_modified());
        ++count;
    }
    EXPECT_GE(count, 20);
}

// Any walk of edits, undos and redos, followed by undos to its start, ends in the bytes of the file; redos then in those
// of the last text.
TEST(SceneDocument, RandomWalkOfEditsAndUndosEndsInTheSameBytes) {
    const unsigned seed = 15;
    std::mt19937 random(seed);
    const fs::path path = fs::path(NEPHOS_SOURCE_DIR) / "scenes/climate.toml";
    for (int walk = 0; walk < 2; ++walk) {
        SCOPED_TRACE("seed " + std::to_string(seed) + ", walk " + std::to_string(walk));
        SceneDocument document(path);
        const std::string first = document.text();
        for (int n = 0; n < 60; ++n) {
            switch (random() % 7) {
                case 0:
                case 1:
                    document.edit(with_value(document.text(), text_path("sun.elevation_deg"),
                                             std::to_string(random() % 90)),
                                  "sun", random() % 2 == 0 ? "sun" : "");
                    break;
                case 2:
                    document.edit(with_value(document.text(), text_path("air.horizon"),
                                             "[0.1, 0.2, 0." + std::to_string(random() % 9 + 1) + "]"),
                                  "air");
                    break;
                case 3: {
                    const Node* skies = value_node(document.values(), text_path("sky"));
                    if (skies == nullptr || skies->items.empty()) break;
                    document.edit(with_copied_element(document.text(), text_path("sky"),
                                                      random() % skies->items.size()),
                                  "copy");
                    break;
                }
                case 4: {
                    const Node* skies = value_node(document.values(), text_path("sky"));
                    if (skies == nullptr || skies->items.empty()) break;
                    const TextPath at{{"sky", 0}, {{}, random() % skies->items.size()}};
                    document.edit(without(document.text(), at), "delete");
                    break;
                }
                case 5:
                    document.undo();
                    break;
                default:
                    document.redo();
                    break;
            }
        }
        const std::string last = document.text();
        int undone = 0;
        while (document.can_undo()) {
            document.undo();
            ++undone;
        }
        EXPECT_EQ(document.text(), first);
        for (int n = 0; n < undone; ++n) document.redo();
        EXPECT_EQ(document.text(), last);
    }
}

TEST(SceneDocument, OneDragIsOneUndo) {
    SceneDocument document(std::string("[sun]\nelevation_deg = 1\n"));
    const TextPath path = text_path("sun.elevation_deg");
    for (const char* value : {"2", "3", "4"})
        document.edit(with_value(document.text(), path, value), "drag", "sun");
    document.end_merging();
    document.edit(with_value(document.text(), path, "5"), "drag", "sun");
    document.undo();
    EXPECT_EQ(document.text(), "[sun]\nelevation_deg = 4\n");
    document.undo();
    EXPECT_EQ(document.text(), "[sun]\nelevation_deg = 1\n");
    EXPECT_FALSE(document.can_undo());
    EXPECT_EQ(document.redo_text(), "drag");
}

TEST(SceneDocument, WhatIsTakenBackHasNotBeen) {
    const std::string first = "[sun]\nelevation_deg = 1.0e0\n";
    SceneDocument document(first);
    const TextPath path = text_path("sun.elevation_deg");
    EXPECT_FALSE(document.take_back("sun"));
    for (const char* value : {"2", "3"})
        document.edit(with_value(document.text(), path, value), "type", "sun");
    EXPECT_FALSE(document.take_back("moon"));
    EXPECT_FALSE(document.take_back(""));
    EXPECT_TRUE(document.take_back("sun"));
    EXPECT_EQ(document.text(), first);
    EXPECT_FALSE(document.can_undo() || document.can_redo() || document.take_back("sun"));
    document.edit(with_value(document.text(), path, "9"), "another");
    document.undo();
    document.edit(with_value(document.text(), path, "3"), "type", "sun");
    EXPECT_FALSE(document.can_redo());
    EXPECT_TRUE(document.take_back("sun"));
    ASSERT_TRUE(document.can_redo());
    document.redo();
    EXPECT_EQ(document.text(), "[sun]\nelevation_deg = 9\n");
    document.undo();
    document.edit(with_value(document.text(), path, "4"), "type", "sun");
    document.end_merging();
    EXPECT_FALSE(document.take_back("sun"));
    EXPECT_NE(document.text(), first);
}

TEST(SceneDocument, ProblemsLeaveTheLastGoodScene) {
    SceneDocument document(std::string("[sun]\nelevation_deg = 12\n"));
    ASSERT_TRUE(document.last_sound_scene());
    document.edit("[sun]\nelevation_deg = 95\n", "type");
    ASSERT_EQ(document.problems().size(), 1u);
    EXPECT_EQ(document.problems()[0].where.line, 2);
    EXPECT_EQ(document.problems()[0].caret, 17);
    EXPECT_EQ(document.last_sound_scene()->render.sun.elevation_deg, 12);
    document.edit("[sun\n", "type");
    EXPECT_EQ(document.problems().size(), 1u);
    EXPECT_NE(value_node(document.values(), text_path("sun.elevation_deg")),
              nullptr);  // the last that could be read
    document.edit("[sun]\nelevation_deg = 13\n", "type");
    EXPECT_TRUE(document.problems().empty());
    EXPECT_EQ(document.last_sound_scene()->render.sun.elevation_deg, 13);
}

TEST(SceneDocument, SeesWhatOtherProgramsDoToItsFile) {
    const Folder folder;
    const fs::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::same);
    write(path, "seed = 2\n");
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::reloaded);
    EXPECT_EQ(document.last_sound_scene()->automaton.seed, 2u);
    EXPECT_FALSE(document.is_modified());
    document.undo();
    EXPECT_EQ(document.text(), "seed = 1\n");
    document.redo();
    write(path, "seed = two\n");  // with a problem: shown, the last good scene stays
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::reloaded);
    EXPECT_EQ(document.problems().size(), 1u);
    EXPECT_EQ(document.last_sound_scene()->automaton.seed, 2u);
    document.edit("seed = 3\n", "mine");
    write(path, "seed = 44\n");
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::differs);
    EXPECT_EQ(document.text(), "seed = 3\n");
    fs::remove(path);
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::gone);
    document.save();
    EXPECT_EQ(content(path), "seed = 3\n");
}

TEST(SceneDocument, UnsavedEditsSurviveACrash) {
    const Folder folder;
    const fs::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    {
        SceneDocument document(path);
        document.edit("seed = 9\n", "edit");
        document.autosave(folder.path);
    }  // no orderly end
    fs::last_write_time(path, fs::last_write_time(path) - std::chrono::seconds(60));
    SceneDocument next(path);
    const auto left = next.left_autosaves(folder.path);
    ASSERT_EQ(left.size(), 1u);
    EXPECT_EQ(left[0].text, "seed = 9\n");
    EXPECT_EQ(left[0].problem, "");
    EXPECT_FALSE(next.file_newer_than(left[0]));
    next.take_autosave(left[0]);
    EXPECT_EQ(next.text(), "seed = 9\n");
    EXPECT_TRUE(SceneDocument(path).left_autosaves(folder.path).empty());  // it is that of `next` now
    next.autosave(folder.path);
    EXPECT_EQ(content(folder.path / ".a.toml.autosave"), "seed = 9\n");
    next.save();
    EXPECT_TRUE(next.left_autosaves(folder.path).empty());  // saved: there is nothing to recover
    EXPECT_FALSE(fs::exists(folder.path / ".a.toml.autosave"));
    EXPECT_EQ(content(path), "seed = 9\n");
}

// Edits of a crashed session, and a file that was written after them: the user has to know, and may keep both.
TEST(SceneDocument, AutosaveOlderThanTheFileSaysSo) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    {
        SceneDocument document(path);
        document.edit("seed = 9\n", "edit");
        document.autosave(folder.path);
    }
    write(path, "seed = 5\n");
    const auto written =
        std::filesystem::last_write_time(folder.path / ".a.toml.autosave") + std::chrono::seconds(9);
    std::filesystem::last_write_time(path, written);
    const SceneDocument next(path);
    EXPECT_EQ(next.text(), "seed = 5\n");
    const auto left = next.left_autosaves(folder.path);
    ASSERT_EQ(left.size(), 1u);
    ASSERT_TRUE(next.file_newer_than(left[0]));
    EXPECT_EQ(*next.file_newer_than(left[0]), written);
    write(folder.path / "a-recovered.toml", "name = \"another\"\n");
    const std::filesystem::path kept = keep_autosave(left[0], "a.toml");
    EXPECT_EQ(kept.filename(), "a-recovered-2.toml");
    EXPECT_EQ(content(kept), "seed = 9\n");
    EXPECT_TRUE(next.left_autosaves(folder.path).empty());
}

// An autosave with what the file has is nothing to ask about.
TEST(SceneDocument, AutosaveThatWasSavedIsNotOffered) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    {
        SceneDocument document(path);
        document.edit("seed = 9\n", "edit");
        document.autosave(folder.path);
    }
    write(path, "seed = 9\n");
    EXPECT_TRUE(SceneDocument(path).left_autosaves(folder.path).empty());
}

// Two editors of one scene: each has a file of its own, neither is offered that of the other, none is overwritten, and
// each file goes with its editor alone. So do two new scenes, which have the same name.
TEST(SceneDocument, TwoEditorsKeepTheirOwnEdits) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml", own = folder.path / ".a.toml.autosave",
                                second =
                                    folder.path / (".a.toml." + std::to_string(::getpid()) + ".autosave");
    write(path, "seed = 1\n");
    SceneDocument a(path), b(path);
    a.edit("seed = 2\n", "edit");
    a.autosave(folder.path);
    EXPECT_TRUE(b.left_autosaves(folder.path).empty());
    b.edit("seed = 3\n", "edit");
    b.autosave(folder.path);
    EXPECT_EQ(content(own), "seed = 2\n");
    EXPECT_EQ(content(second), "seed = 3\n");
    a.edit("seed = 4\n", "edit");
    a.autosave(folder.path);
    EXPECT_EQ(content(own), "seed = 4\n");
    struct stat status {};
    ASSERT_EQ(::stat(own.c_str(), &status), 0);
    LeftAutosave live{own, {}, "seed = 4\n", {}, "a.toml", status.st_dev, status.st_ino};
    EXPECT_THROW(b.take_autosave(live), Error);
    EXPECT_THROW(delete_autosave(live), Error);
    EXPECT_THROW(keep_autosave(live, "a.toml"), Error);
    b.save();
    EXPECT_FALSE(std::filesystem::exists(second));
    EXPECT_EQ(content(own), "seed = 4\n");
    // Somebody removes the file: it is written again without another edit.
    std::filesystem::remove(own);
    a.autosave(folder.path);
    EXPECT_EQ(content(own), "seed = 4\n");

    SceneDocument c(std::string("seed = 5\n")), d(std::string("seed = 5\n"));
    c.edit("seed = 6\n", "edit");
    d.edit("seed = 7\n", "edit");
    c.autosave(folder.path);
    d.autosave(folder.path);
    EXPECT_EQ(content(folder.path / ".untitled.toml.autosave"), "seed = 6\n");
    EXPECT_TRUE(SceneDocument(std::string("seed = 5\n")).left_autosaves(folder.path).empty());
}

// One in the way of each name of a scene's edits, as root may write everywhere.
void put_folders_in_the_way(const std::filesystem::path& scenes, const std::string& name) {
    for (int n = 0; n < 1000; ++n) {
        const std::string middle =
            n == 0 ? "" : "." + std::to_string(::getpid()) + (n > 1 ? "-" + std::to_string(n) : "");
        std::filesystem::create_directory(scenes / ("." + name + middle + ".autosave"));
    }
}

// Beside an installed scene one cannot write: its edits, and those of its copies, are kept in the folder of settings, under
// names that tell them from those of scenes called alike.
TEST(SceneDocument, EditsOfASceneWhoseFolderCannotBeWrittenAreKeptElsewhere) {
    const Folder folder;
    const std::filesystem::path settings = folder.path / "settings", one = folder.path / "one",
                                two = folder.path / "two";
    for (const std::filesystem::path& scenes : {one, two}) {
        std::filesystem::create_directory(scenes);
        write(scenes / "a.toml", "seed = 1\n");
        for (const std::string name : {"a.toml", "a-2.toml"}) put_folders_in_the_way(scenes, name);
    }
    {
        SceneDocument document(one / "a.toml"), copy("seed = 1\n", "a-2.toml", one);
        document.edit("seed = 7\n", "edit");
        copy.edit("seed = 8\n", "edit");
        document.autosave(settings);
        copy.autosave(settings);
    }
    SceneDocument next(one / "a.toml");
    auto left = next.left_autosaves(settings);
    ASSERT_EQ(left.size(), 2u);
    std::ranges::sort(left, {}, &LeftAutosave::scene);
    EXPECT_EQ(left[0].scene, "a-2.toml");
    EXPECT_EQ(left[1].scene, "a.toml");
    next.take_autosave(left[1]);
    EXPECT_EQ(next.text(), "seed = 7\n");
    next.save();
    EXPECT_EQ(next.left_autosaves(settings).size(), 1u);
    EXPECT_TRUE(SceneDocument(two / "a.toml").left_autosaves(settings).empty());
}

// Keeps the edits of a new scene, or of a copy, as those of the file that it was saved as.
TEST(SceneDocument, EditsKeptElsewhereAreOfTheFileThatWasSaved) {
    const Folder folder;
    const std::filesystem::path settings = folder.path / "settings", one = folder.path / "one",
                                two = folder.path / "two";
    for (const std::filesystem::path& scenes : {one, two}) std::filesystem::create_directory(scenes);
    for (const std::string name : {"a.toml", "b.toml"}) put_folders_in_the_way(two, name);
    {
        SceneDocument made(std::string("seed = 1\n")), copy("seed = 2\n", "b.toml", one);
        made.save_as(two / "a.toml");
        copy.save_as(two / "b.toml");
        made.edit("seed = 7\n", "edit");
        copy.edit("seed = 8\n", "edit");
        made.autosave(settings);
        copy.autosave(settings);
    }
    for (const auto& [name, text] : {std::pair("a.toml", "seed = 7\n"), std::pair("b.toml", "seed = 8\n")}) {
        SceneDocument next(two / name);
        const auto left = next.left_autosaves(settings);
        ASSERT_EQ(left.size(), 1u) << name;
        EXPECT_EQ(left[0].text, text);
        write(one / name, "seed = 3\n");
        EXPECT_TRUE(SceneDocument(one / name).left_autosaves(settings).empty()) << name;
    }
}

// Names of the folder of settings tell all folders of scenes from each other.
TEST(SceneDocument, EditsKeptElsewhereAreOfOneFolder) {
    const Folder folder;
    const std::filesystem::path settings = folder.path / "settings", one = folder.path / "p%q",
                                two = folder.path / "p/q";
    {
        std::filesystem::create_directories(one);
        write(one / "a.toml", "seed = 1\n");
        SceneDocument document(one / "a.toml");
        document.edit("seed = 7\n", "edit");
        std::filesystem::remove_all(one);  // it cannot be written beside
        document.autosave(settings);
    }
    EXPECT_EQ(SceneDocument::opened(one / "a.toml", settings)->left_autosaves(settings).size(), 1u);
    EXPECT_THROW(SceneDocument::opened(two / "a.toml", settings), Error);
    std::filesystem::create_directories(two);
    write(two / "a.toml", "seed = 1\n");
    EXPECT_TRUE(SceneDocument(two / "a.toml").left_autosaves(settings).empty());
    // Reached by a link that leads nowhere while they are kept.
    const std::filesystem::path disk = folder.path / "disk", away = folder.path / "away",
                                link = folder.path / "link";
    std::filesystem::create_directory(disk);
    std::filesystem::create_symlink("disk", link);
    write(disk / "a.toml", "seed = 1\n");
    {
        SceneDocument document(link / "a.toml");
        document.edit("seed = 8\n", "edit");
        std::filesystem::rename(disk, away);
        document.autosave(settings);
    }
    std::filesystem::rename(away, disk);
    EXPECT_EQ(SceneDocument(link / "a.toml").left_autosaves(settings).size(), 1u);
    EXPECT_EQ(SceneDocument(disk / "a.toml").left_autosaves(settings).size(), 1u);
}

// The text of a file that is gone is nowhere else.
TEST(SceneDocument, AFileThatIsGoneIsUnsaved) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    EXPECT_FALSE(document.is_modified());
    std::filesystem::remove(path);
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::gone);
    EXPECT_TRUE(document.is_modified());
    document.autosave(folder.path);
    EXPECT_EQ(content(folder.path / ".a.toml.autosave"), "seed = 1\n");
    write(path, "seed = 1\n");
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::same);
    EXPECT_FALSE(document.is_modified());
    document.autosave(folder.path);
    EXPECT_FALSE(std::filesystem::exists(folder.path / ".a.toml.autosave"));
    std::filesystem::remove(path);
    document.look_at_disk();
    write(path, "seed = 2\n");  // of another program: what was gone is in no file
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::differs);
    EXPECT_TRUE(document.is_modified());
    EXPECT_TRUE(document.is_changed_on_disk());
    document.autosave(folder.path);
    EXPECT_EQ(content(folder.path / ".a.toml.autosave"), "seed = 1\n");
    write(path, "seed = 1\n");  // it is in a file again, which a scene that is not shown looks at as well
    document.autosave(folder.path);
    EXPECT_FALSE(document.is_modified());
    EXPECT_FALSE(std::filesystem::exists(folder.path / ".a.toml.autosave"));
    write(path, "seed = 2\n");
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::reloaded);
    std::filesystem::remove(path);
    document.look_at_disk();
    document.save();
    EXPECT_FALSE(document.is_modified());
    EXPECT_EQ(content(path), "seed = 2\n");
}

// A copy is saved as long as the file of the original has its text.
TEST(SceneDocument, ACopyIsUnsavedOnceTheOriginalIsAnother) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    const std::unique_ptr<SceneDocument> copy = document.copy_of_saved("a-2.toml");
    const std::unique_ptr<SceneDocument> second = copy->copy_of_saved("a-3.toml");
    EXPECT_FALSE(copy->is_modified());
    document.edit("seed = 2\n", "edit");
    const std::unique_ptr<SceneDocument> edited = document.copy_of_saved("a-4.toml");
    edited->edit(document.text(), "Copy");
    EXPECT_TRUE(edited->is_modified());
    document.save();
    for (SceneDocument* one : {copy.get(), second.get()}) {
        one->autosave(folder.path);
        EXPECT_TRUE(one->is_modified());
        EXPECT_EQ(content(folder.path / ("." + one->title() + ".autosave")), "seed = 1\n");
    }
    write(path, "seed = 1\n");
    copy->look_at_disk();
    EXPECT_FALSE(copy->is_modified());
    std::filesystem::remove(path);
    copy->look_at_disk();
    EXPECT_TRUE(copy->is_modified());
    copy->save_as(folder.path / "b.toml");
    copy->look_at_disk();
    EXPECT_FALSE(copy->is_modified());
}

// A folder in its place is no file of it, also for a scene that is not shown.
TEST(SceneDocument, AFolderInItsPlace) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    std::filesystem::remove(path);
    std::filesystem::create_directory(path);
    document.autosave(folder.path);
    EXPECT_TRUE(document.is_gone());
    EXPECT_EQ(content(folder.path / ".a.toml.autosave"), "seed = 1\n");
}

// Has no text that could be lost: edits are left of it, and none were taken.
TEST(SceneDocument, AFileThatComesBackWhileEditsAreLeftIsRead) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(folder.path / ".a.toml.autosave", "seed = 1\n");
    const std::unique_ptr<SceneDocument> document = SceneDocument::opened(path, folder.path);
    EXPECT_TRUE(document->is_modified());
    write(path, "seed = 2\n");
    EXPECT_EQ(document->look_at_disk(), SceneDocument::Disk::reloaded);
    EXPECT_FALSE(document->is_modified());
}

// A copy of a scene that was never saved leaves its edits beside the scene, which offers them; not those of a scene that
// is a file itself, or whose name only begins alike.
TEST(SceneDocument, EditsOfACopyAreOfferedWithTheScene) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    for (const char* name : {"a-2.toml", "a-2-2.toml", "a-3.toml", "a-b.toml", "a-.toml", "ab.toml"}) {
        SceneDocument copy("seed = 1\n", name, folder.path);
        EXPECT_FALSE(copy.is_modified());
        copy.edit("seed = 2\n", "edit");
        copy.autosave(folder.path / "settings");
        EXPECT_TRUE(std::filesystem::exists(folder.path / (std::string(".") + name + ".autosave"))) << name;
    }
    write(folder.path / "a-3.toml", "seed = 3\n");
    auto left = SceneDocument(path).left_autosaves(folder.path / "settings");
    ASSERT_EQ(left.size(), 2u);
    std::ranges::sort(left, {}, &LeftAutosave::scene);
    EXPECT_EQ(left[0].scene, "a-2-2.toml");  // a copy of the copy
    EXPECT_EQ(left[1].scene, "a-2.toml");
    SceneDocument again("seed = 1\n", left[0].scene, folder.path);
    again.take_autosave(left[0]);
    EXPECT_EQ(again.text(), "seed = 2\n");
    EXPECT_EQ(SceneDocument(path).left_autosaves(folder.path).size(), 1u);
}

// Two editors are asked about the same file. One takes it, edits and ends by a crash: what the other decides is not done
// to the newer edits, which it has never shown. Nor are edits lost that cannot be read.
TEST(SceneDocument, NewerEditsOfTheSameNameAreNotTouched) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml", own = folder.path / ".a.toml.autosave";
    write(path, "seed = 1\n");
    write(own, "seed = 2\n");
    const auto asked = SceneDocument(path).left_autosaves(folder.path);
    ASSERT_EQ(asked.size(), 1u);
    {
        SceneDocument first(path);
        first.take_autosave(asked[0]);
        first.edit("seed = 3\n", "edit");
        first.autosave(folder.path);
    }
    EXPECT_THROW(delete_autosave(asked[0]), Error);
    EXPECT_THROW(keep_autosave(asked[0], "a.toml"), Error);
    SceneDocument second(path);
    EXPECT_THROW(second.take_autosave(asked[0]), Error);
    second.autosave(folder.path);
    EXPECT_EQ(content(own), "seed = 3\n");
    std::filesystem::resize_file(own, kMaxSceneBytes + 1);
    const auto large = SceneDocument(path).left_autosaves(folder.path);
    ASSERT_EQ(large.size(), 1u);
    EXPECT_THROW(second.take_autosave(large[0]), Error);
    EXPECT_FALSE(second.is_modified());
    second.autosave(folder.path);
    EXPECT_TRUE(std::filesystem::exists(own));
}

// Files that are there stay: those of crashed sessions until somebody answers, and one that cannot be read, which is
// asked about and not taken for none.
TEST(SceneDocument, AutosaveLeavesOtherFilesAlone) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    write(folder.path / ".a.toml.autosave", std::string("seed = \xff\xfe\n"));
    write(folder.path / ".a.toml.4711.autosave", "seed = 8\n");
    write(folder.path / ".a.toml.backup.autosave", "seed = 7\n");  // not one of ours
    std::filesystem::create_directory(folder.path / ".b.toml.autosave");
    std::filesystem::last_write_time(folder.path / ".a.toml.4711.autosave",
                                     std::filesystem::last_write_time(path) - std::chrono::seconds(100));
    SceneDocument document(path);
    document.edit("seed = 2\n", "edit");
    document.autosave(folder.path);
    document.edit("seed = 3\n", "edit");
    document.autosave(folder.path);
    EXPECT_EQ(content(folder.path / ".a.toml.autosave"), "seed = \xff\xfe\n");
    EXPECT_EQ(content(folder.path / ".a.toml.4711.autosave"), "seed = 8\n");
    const auto left = SceneDocument(path).left_autosaves(folder.path);
    ASSERT_EQ(left.size(), 2u);
    EXPECT_EQ(left[1].text, "seed = 8\n");
    if (::geteuid() != 0) {  // root reads everything
        std::filesystem::permissions(left[1].path, std::filesystem::perms::none);
        const auto unreadable = SceneDocument(path).left_autosaves(folder.path);
        ASSERT_EQ(unreadable.size(), 2u);
        EXPECT_NE(unreadable[1].problem, "");
        std::filesystem::permissions(left[1].path, std::filesystem::perms::owner_all);
    }
    std::filesystem::resize_file(folder.path / ".a.toml.4711.autosave", kMaxSceneBytes + 1);
    const auto large = SceneDocument(path).left_autosaves(folder.path);
    ASSERT_EQ(large.size(), 2u);
    EXPECT_NE((large[0].problem + large[1].problem).find("too large"), std::string::npos);
    SceneDocument b(folder.path / "a.toml");
    EXPECT_NO_THROW(b.autosave(folder.path));
}

// A file that another program writes with the time and size that it had before: saving sees its content.
TEST(SceneDocument, SavingComparesTheContent) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    const auto time = std::filesystem::last_write_time(path);
    write(path, "seed = 2\n");
    std::filesystem::last_write_time(path, time);
    EXPECT_TRUE(document.is_changed_on_disk());
    document.save();
    EXPECT_FALSE(document.is_changed_on_disk());
    EXPECT_EQ(content(path), "seed = 1\n");
    // Replaced by another file of the same time and size: another inode.
    write(folder.path / "b.toml", "seed = 3\n");
    std::filesystem::last_write_time(folder.path / "b.toml", std::filesystem::last_write_time(path));
    std::filesystem::rename(folder.path / "b.toml", path);
    EXPECT_EQ(document.look_at_disk(), SceneDocument::Disk::reloaded);
    EXPECT_EQ(document.text(), "seed = 3\n");
}

TEST(SceneDocument, KnowsWhatAnotherProgramWrote) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "a.toml";
    write(path, "seed = 1\n");
    SceneDocument document(path);
    EXPECT_FALSE(document.is_changed_on_disk());
    const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
    write(path, "seed = 2\n");
    std::filesystem::last_write_time(path, later);
    EXPECT_TRUE(document.is_changed_on_disk());
    document.save();
    EXPECT_FALSE(document.is_changed_on_disk());
    EXPECT_EQ(content(path), "seed = 1\n");
}

TEST(SceneDocument, SyntaxErrorsAreToldFromOtherProblems) {
    SceneDocument document(std::string("seed = 1\n"));
    EXPECT_FALSE(document.has_syntax_error());
    document.edit("=", "type");
    EXPECT_TRUE(document.has_syntax_error());
    document.edit("sea = 1\n", "type");
    EXPECT_FALSE(document.has_syntax_error());
    EXPECT_FALSE(document.problems().empty());
    ASSERT_TRUE(document.last_sound_scene());  // the last good one
    EXPECT_EQ(document.last_sound_scene()->automaton.seed, 1u);
}

TEST(SceneDocument, SavingWhereItCannotKeepsTheEdits) {
    SceneDocument document(std::string("seed = 1\n"));
    document.edit("seed = 2\n", "edit");
    EXPECT_THROW(document.save_as("/proc/nowhere/a.toml"), Error);
    EXPECT_TRUE(document.is_modified());
    EXPECT_FALSE(document.has_file());
}

// New elements of every list are valid by themselves, whatever their required keys are.
TEST(SchemaValues, NewElementsHaveTheirRequiredKeys) {
    const auto made = [](const std::string& text, const std::string& path) {
        SceneDocument document(text);
        const TextPath at = text_path(path);
        const Key* key = key_at(at);
        EXPECT_NE(key, nullptr) << path;
        const std::optional<Scene>& scene = document.last_sound_scene();
        return with_new_element(
            text, at, new_element(*key, document.values(), at, scene ? &*scene : nullptr, {0, 0, 1000}));
    };
    std::string text = "name = \"a\"\n";
    for (const char* path : {"field.ellipsoids", "field.scatters", "wind", "lightning", "camera.path"}) {
        text = made(text, path);
        SceneDocument document(text);
        EXPECT_TRUE(document.problems().empty()) << path << "\n" << format(document.problems()) << text;
    }
    // A flash need not be later than the one before; a wind has to be, also where six digits hide that.
    const std::string flashes = made(made("name = \"a\"\n", "lightning"), "lightning");
    EXPECT_EQ(flashes.find("time_s"), std::string::npos) << flashes;
    const std::string late =
        made("[[wind]]\ntime_s = 999998000\nlevels = [{ height_m = 0, from_deg = 0, speed_m_per_s = 1 }]\n",
             "wind");
    EXPECT_NE(late.find("time_s = 999998600"), std::string::npos) << late;
    std::string sky = "name = \"a\"\n";
    for (const char* path : {"model", "sky", "layer"}) sky = made(sky, path);
    EXPECT_TRUE(SceneDocument(sky).problems().empty()) << format(SceneDocument(sky).problems()) << sky;
    for (const char* path : {"model[0].seeds", "model[0].seeds[0].roots", "sky", "layer[0].rain.placed",
                             "climate.schedule", "model"}) {
        sky = made(sky, path);
        EXPECT_TRUE(SceneDocument(sky).problems().empty()) << path << "\n"
                                                           << format(SceneDocument(sky).problems()) << sky;
    }
}

// Whose values rise: in the middle to the next, or a step on; nowhere where there is no room.
TEST(SchemaValues, CopiesHaveAPlaceOfTheirOwn) {
    const auto place = [](const std::string& list, const std::string& items, std::size_t index) {
        const SceneDocument document("name = \"a\"\n[[layer]]\nveil = {}\n" + items);
        const TextPath at = text_path(list);
        return place_of_copy(*key_at(at), *value_node(document.values(), at), index);
    };
    const std::string states = "presence = [{ state = 0, cover = 0 }, { state = 1, cover = 1 }]\n";
    EXPECT_EQ(place("layer[0].presence", states, 0), (TextEntry{"state", "0.5"}));
    EXPECT_THROW(place("layer[0].presence", states, 1), Error);  // 1 is the last
    const auto winds = [](const std::string& first, const std::string& second) {
        const std::string levels = "levels = [{ height_m = 0 }]\n";
        return "[[layer.wind]]\ntime_s = " + first + "\n" + levels + "[[layer.wind]]\ntime_s = " + second +
               "\n" + levels;
    };
    EXPECT_EQ(place("layer[0].wind", winds("0", "10"), 1), (TextEntry{"time_s", "610"}));
    EXPECT_EQ(place("layer[0].wind", winds("100000000", "100000000.5"), 0),
              (TextEntry{"time_s", "100000000.25"}));
    EXPECT_THROW(place("layer[0].wind", winds("1", "1.0000000000000002"), 0), Error);
    EXPECT_EQ(place("layer", "", 0), std::nullopt);
}

TEST(SchemaValues, RenamingFollowsReferences) {
    const std::string text =
        "[[model]]\nname = \"a\"\nseeds = [{}]\n[[sky]]\nname = \"s\"\nstate = 0\nmodels = [\"a\", \"b\"] # "
        "two\n"
        "[[layer]]\nname = \"l\"\nskies = \"s\"\n";
    const SceneDocument document(text);
    const std::string renamed =
        with_new_name(text, document.values(), text_path("model[0].name"), "new \"a\"", {});
    EXPECT_NE(renamed.find("models = [\"new \\\"a\\\"\", \"b\"] # two"), std::string::npos) << renamed;
    EXPECT_NE(with_new_name(text, document.values(), text_path("sky[0].name"), "t", {}).find("skies = \"t\""),
              std::string::npos);
}

TEST(SchemaValues, RenamingFollowsRainAreasAndMetamorphoses) {
    const std::string text =
        "[[model]]\nname = \"a\"\n[[model]]\nname = \"b\"\n[[layer]]\nname = \"l\"\nrain = { attached = [{ "
        "model = \"a\" }] }\n"
        "metamorphoses = [{ from = \"a\", to = \"b\" }, { from = \"b\", to = \"a\" }]\n";
    const SceneDocument document(text);
    const std::string renamed = with_new_name(text, document.values(), text_path("model[0].name"), "c", {});
    EXPECT_NE(renamed.find("{ model = \"c\" }"), std::string::npos) << renamed;
    EXPECT_NE(renamed.find("[{ from = \"c\", to = \"b\" }, { from = \"b\", to = \"c\" }]"), std::string::npos)
        << renamed;
}

TEST(SchemaValues, RenamingToATakenNameIsRefused) {
    const std::string text =
        "[[model]]\nname = \"a\"\n[[model]]\nname = \"b\"\n[[sky]]\nname = \"s\"\nmodels = [\"a\", \"b\"]\n";
    const SceneDocument document(text);
    EXPECT_THROW(with_new_name(text, document.values(), text_path("model[1].name"), "a", {}), Error);
    EXPECT_EQ(with_new_name(text, document.values(), text_path("model[1].name"), "b", {}), text);
    // Where two of a text have one name already, nobody knows which of them is meant.
    const std::string same =
        "[[model]]\nname = \"a\"\n[[model]]\nname = \"a\"\n[[sky]]\nname = \"s\"\nmodels = \"a\"\n";
    const SceneDocument doubled(same);
    EXPECT_NE(
        with_new_name(same, doubled.values(), text_path("model[1].name"), "c", {}).find("models = \"a\""),
        std::string::npos);
}

TEST(SchemaValues, OwnersAndDefaults) {
    const SceneDocument document(fs::path(NEPHOS_SOURCE_DIR) / "scenes/climate.toml");
    const Scene& scene = *document.last_sound_scene();
    const TextPath layer = text_path("layer[1]");
    EXPECT_EQ(owner_at(scene, layer, 0), &scene.layers[1]);
    EXPECT_EQ(owner_at(scene, text_path("layer[0].rain.finder"), 0) == nullptr, false);
    EXPECT_EQ(owner_at(scene, text_path("model[0]"), 2), &scene.models[2]);
    EXPECT_EQ(owner_at(scene, text_path("nothing"), 0), nullptr);
    EXPECT_EQ(default_value(*key_at(text_path("layer[1].opacity")), owner_at(scene, layer, 0)), "0.35");
    EXPECT_EQ(readable_name("elevation_deg"), "Elevation");
    EXPECT_EQ(element_name("scatters"), "Scatter");
}

// Every key of every section has a default that reads as TOML, also of elements that are not there.
void visit(const Scene& scene, const Section& section, const TextPath& path, int depth, int& count) {
    const void* owner = owner_at(scene, path, 0);
    for (const Key& key : section.keys) {
        TextPath at = path;
        at.push_back({key.name, 0});
        SCOPED_TRACE(path_text(at));
        if (key.section == nullptr) {
            const std::string value = default_value(key, owner);
            if (!value.empty()) {
                EXPECT_NE(parsed_value(value).kind, Node::Kind::table) << value;
                ++count;
            }
            EXPECT_FALSE(readable_name(key).empty());
        } else if (depth < 5) {
            if (key.kind == KeyKind::tables) at.push_back({{}, 3});
            visit(scene, *key.section, at, depth + 1, count);
        }
    }
}

TEST(SchemaValues, EveryKeyHasAReadableDefault) {
    int count = 0;
    visit(Scene{}, scene_section(), {}, 0, count);
    visit(read_scene(fs::path(NEPHOS_SOURCE_DIR) / "scenes/storm.toml"), scene_section(), {}, 0, count);
    EXPECT_GT(count, 400);
}

}  // namespace
}  // namespace nephos
