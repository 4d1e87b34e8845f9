// SPDX-License-Identifier: Apache-2.0
// The section of the place on Earth.

#include "core/place.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

namespace {

void finish_georeference(const SectionReader& reader, void* owner) {
    Georeference& place = static_cast<Scene*>(owner)->georeference;
    const bool any = !reader.table.entries.empty();
    if (!any) return;
    place.given = true;
    for (const char* name : {"latitude_deg", "longitude_deg"}) {
        if (reader.find(name) != nullptr) continue;
        reader.report(name, reader.quoted(name) + " is missing",
                      "expected `latitude_deg` and `longitude_deg` of the world's origin");
    }
    if (reader.find("start_utc") != nullptr && !place.start_utc.empty() && !utc_seconds(place.start_utc)) {
        reader.report(
            "start_utc", reader.quoted("start_utc") + " is \"" + shortened(place.start_utc) + "\"",
            "expected a moment from 1900 to 2100, in whole seconds, such as \"2024-06-21T13:50:00Z\"");
        place.start_utc.clear();
    }
}

}  // namespace

const Section& georeference_section() {
    static const Section section{
        "Georeference",
        "Where on Earth, and when, the scene lies: the place of the world's origin (0, 0, 0), from which x, "
        "y and z are "
        "a flat tangent frame. Files name it, with the matrix to ECEF; the sun stands where it does there "
        "and then, "
        "unless [sun] has a height or a date of its own. See docs/flight-simulators.md.",
        {key<&Scene::georeference, &Georeference::latitude_deg>(
             "latitude_deg", "deg", between(-90, 90), "Geodetic latitude (WGS 84); north is positive."),
         key<&Scene::georeference, &Georeference::longitude_deg>("longitude_deg", "deg", between(-180, 180),
                                                                 "Longitude; east is positive."),
         key<&Scene::georeference, &Georeference::height_m>(
             "height_m", "m", between(-1000, 100'000),
             "Height of the origin, z = 0: of an aerodrome, if heights of the scene are above it."),
         word<&Scene::georeference, &Georeference::height_datum>(
             "height_datum", {"msl", "ellipsoid"},
             "What that height is above: mean sea level, or the ellipsoid. Weather reports and simulators "
             "count from mean "
             "sea level: `geoid_height_m` says where that is."),
         key<&Scene::georeference, &Georeference::geoid_height_m>(
             "geoid_height_m", "m", between(-200, 200),
             "Height of mean sea level above the ellipsoid there (undulation), by which heights are told to "
             "ECEF and, "
             "from the ellipsoid, to simulators: 45 m in London, -32 m in Miami."),
         key<&Scene::georeference, &Georeference::heading_deg>(
             "heading_deg", "deg", between(-360, 360),
             "True bearing of the y axis, clockwise: 0 makes x east and y north. All directions of the "
             "scene, wind and "
             "`sun.azimuth_deg` too, are relative to its y axis."),
         key<&Scene::georeference, &Georeference::start_utc>(
             "start_utc", "", kAny,
             "Moment of simulated time 0 in Coordinated Universal Time, such as \"2024-06-21T13:50:00Z\".")},
        &finish_georeference};
    return section;
}

}  // namespace nephos
