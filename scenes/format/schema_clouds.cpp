// SPDX-License-Identifier: Apache-2.0
// The sections of T's clouds: base models with their seeds and roots, and skies.

#include <algorithm>

#include "scenes/format/named_files.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

namespace {

constexpr double kLargest_m = 1e6;
constexpr Limits kCount = between(0, 10'000);
constexpr std::size_t kMostTextures = 100;  // of a base model

const Section& root_section() {
    constexpr Limits kAngle = between(-360, 360);
    static const Section section{
        "Roots",
        "Roots of a seed: where its children appear, and how many. A child lies its parent's radius times "
        "the number "
        "of its reproduction away, in a direction drawn within the opening; it has the parent's size.",
        {key<&Root::pitch_deg>("pitch_deg", "deg", kAngle, "Direction up from the horizon.", "T, 3.1"),
         key<&Root::yaw_deg>("yaw_deg", "deg", kAngle,
                             "Direction counter-clockwise from east, seen from above.", "T, 3.1"),
         key<&Root::open_pitch_deg>("open_pitch_deg", "deg", between(0, 360),
                                    "Vertical angle within which a child's direction varies; 0: not at all.",
                                    "T, 3.1"),
         key<&Root::open_yaw_deg>("open_yaw_deg", "deg", between(0, 360),
                                  "The same horizontally; below 180 the opening is a cone.", "T, 3.1"),
         key<&Root::seeds_start>("seeds_start", "", kCount, "Children in the first reproduction.", "T, 3.1"),
         key<&Root::seeds_end>("seeds_end", "", kCount, "Children in the last one; linear between.",
                               "T, 3.1"),
         key<&Root::reproductions>("reproductions", "", kCount,
                                   "Number of reproductions, drawn for each cloud.", "T, 3.1"),
         word<&Root::radius>(
             "radius", {"sphere", "box"},
             "What a parent's radius is: half of its box's diagonal, or the way from its centre to "
             "the face that the direction meets, which keeps flat boxes together.")},
        nullptr};
    return section;
}

const Section& seed_section() {
    static const Section section{
        "Seeds",
        "The boxes that an artist sets: billboards are scattered in them, and each makes an ellipsoid of the "
        "automaton's field.",
        {key<&Seed::position_m>(
             "position_m", "m", between(-kLargest_m, kLargest_m),
             "Centre of the box in the cloud's own space, where height 0 is the cloud's base.", "T, 3.1"),
         key<&Seed::size_m>("size_m", "m", between(kSmallestSize_m, kLargest_m),
                            "Width (east), depth (north) and height of the box.", "T, 3.1"),
         key<&Seed::billboards>("billboards", "", kCount, "Number of billboards in the box.", "T, 3.1"),
         key<&Seed::billboard_width_m>("billboard_width_m", "m",
                                       between(kSmallestSize_m, kLargestBillboard_m), "Their width.",
                                       "T, 3.1"),
         key<&Seed::billboard_height_m>("billboard_height_m", "m",
                                        between(kSmallestSize_m, kLargestBillboard_m), "Their height.",
                                        "T, 3.1"),
         word<&Seed::texture>("texture", {"soft", "wispy", "dense"}, "Kind of their texture.", "T, 3.1"),
         key<&Seed::strength>("strength", "", between(0, 1), "Weight of the box in the automaton's field."),
         tables<&Seed::roots>("roots", root_section(), 0, 1000)},
        nullptr};
    return section;
}

void finish_model(const SectionReader& reader, void* owner) {
    auto& model = *static_cast<BaseModel*>(owner);
    model.own_centre = reader.find("centre") != nullptr;
    model.own_rim = reader.find("rim") != nullptr;
    if (model.textures.size() > kMostTextures) {
        reader.report("textures", reader.quoted("textures") + " has " + std::to_string(model.textures.size()) + " files",
                      "expected at most " + std::to_string(kMostTextures));
    }
    if (reader.find("textures") != nullptr && model.textures.empty())
        reader.report("textures", reader.quoted("textures") + " names no file", "expected names of PNG files, or no such key");
    if (std::ranges::any_of(model.textures, names_no_file))
        reader.report("textures", reader.quoted("textures") + " has a text that names no file",
                      "expected names of PNG files");
    try {
        check(model);
    } catch (const Error& error) {
        reader.report("", error.what(), "expected fewer seeds, children or reproductions");
    }
}

}  // namespace

const Section& model_section() {
    static const Section section{
        "Base models",
        "Clouds as an artist describes them: any number of different clouds are made of one base model. Also "
        "taken "
        "from other files with `models`.",
        {required(key<&BaseModel::name>("name", "", kAny, "What skies call it.")),
         genus_word<&BaseModel::genus>("genus",
                                       "The genus of the clouds, by its WMO abbreviation; rain may be "
                                       "attached to it.",
                                       "T, 2"),
         key<&BaseModel::light_distance_m>("light_distance_m", "m", or_infinite(above(0, 0)),
                                           "Way of light in the cloud after which it is absorbed: of "
                                           "billboards in the cloud's boxes, of the voxels of an "
                                           "automaton in the ellipsoids that the boxes are there "
                                           "(`layer.light_absorption`). Short: dark rain clouds; "
                                           "infinite: bright ones.",
                                           "T, CFA"),
         default_is(
             written_if(
                 key<&BaseModel::textures>(
                     "textures", "", kAny,
                     "PNG files with transparency, relative to the scene's folder: each billboard is one of "
                     "them, upright, in place of its seed's `texture`. Alpha is opacity, luminance scales "
                     "the light.",
                     "T, 3.1"),
                 [](const void* model) { return !static_cast<const BaseModel*>(model)->textures.empty(); }),
             "those of the seeds' `texture`"),
         default_is(
             written_if(
                 table<&BaseModel::centre>(
                     "centre", probabilities_section(),
                     "Probabilities at the centre of its boxes' ellipsoids, in every layer's automaton."),
                 [](const void* model) { return static_cast<const BaseModel*>(model)->own_centre; }),
             "that of `layer.coupling`"),
         default_is(
             written_if(table<&BaseModel::rim>("rim", probabilities_section(), "The same at their rim."),
                        [](const void* model) { return static_cast<const BaseModel*>(model)->own_rim; }),
             "that of `layer.coupling`"),
         required(tables<&BaseModel::seeds>("seeds", seed_section(), 1, 10'000))},
        &finish_model};
    return section;
}

const Section& sky_section() {
    static const Section section{
        "Skies",
        "The clouds of an atmospheric state. Clouds that enter a layer come from the two skies on both sides "
        "of the "
        "present state, the nearer one the more often.",
        {required(key<&NamedSky::name>("name", "", kAny, "What layers call it.")),
         required(key<&NamedSky::state>("state", "", between(0, 1),
                                        "The atmospheric state: 0 clear, 1 storm.", "T, 3.4")),
         key<&NamedSky::clouds>("clouds", "", between(0, 100'000),
                                "Number of clouds in the world at this state.", "T, 3.4"),
         default_is(
             key<&NamedSky::models>("models", "", kAny, "Names of base models, equally likely.", "T, 3.4"),
             "none"),
         key<&NamedSky::generated>("generated", "", between(1, 65'536),
                                   "Different clouds made of each base model.", "T, table of skies")},
        nullptr};
    return section;
}

}  // namespace nephos
