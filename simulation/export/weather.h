// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clouds without voxels: a summary of each layer in each frame, and what simulators make of such summaries.

#include <optional>
#include <string>
#include <vector>

#include "density/optical_columns.h"
#include "simulation/export/export.h"
#include "simulation/run_listing.h"

namespace nephos {

struct LayerSummary {
    std::string name,
        genus;              // genus: WMO abbreviation, "" where the scene names none, "VV" of an obscured sky
    bool towering = false;  // cumulus that is a TCU
    OpticalColumns columns;
    double oktas = 0;         // 8 times the cover
    double transition_m = 0;  // from the base to where the layer has half of its mean density
    double wind_from_deg = 0, wind_m_per_s = 0;  // at the base; the bearing is true
    double rain_mm_per_h = 0;                    // the strongest of its areas
};

// The rectangle of all lattices on Earth: its centre, its edges and the true bearing of its y axis.
struct WeatherRegion {
    double latitude_deg = 0, longitude_deg = 0, east_m = 0, north_m = 0, heading_deg = 0;
};

struct WeatherSummary {
    int number = 1;
    double time_s = 0;
    std::string utc;                                   // empty without a start
    std::vector<LayerSummary> layers;                  // with any column of optical depth above 1; from below
    std::vector<std::pair<double, Velocity>> wind;     // by height
    double surface_from_deg = 0, surface_m_per_s = 0;  // at 10 m; true
    double visibility_m = 9999;                        // of the fog; 9999: none
    double rain_mm_per_h = 0;
    bool snow = false, showers = false;
    bool thunder = false;  // a flash is within half an hour of the frame
    std::string
        precipitation;  // what falls as reports write it, such as "FZRA"; empty: the scene does not name it
    double fog_depth_m = 0;               // scale height; 0: none
    double elevation_m = 0;               // of z = 0 above mean sea level
    double heading_deg = 0;               // true bearing of the y axis
    std::optional<WeatherRegion> region;  // of a scene with a place on Earth
    double snow_depth_m = 0;              // on the ground
};

// Reads the density files of a frame: of its layers, or the only one; adds a note for each that is not as the run's manifest
// lists it. Throws Error(io) as load_density(), and where one changes meanwhile.
WeatherSummary summarise(const RunListing& run, const ListedFrame& frame, std::vector<std::string>& notes);

// Return the report of a summary, its station the scene's name if that is four capital letters, else ZZZZ; the element
// of one frame for layers.json; X-Plane's XPLMWeatherInfo_t as JSON; MSFS's weather preset.
std::string metar_of(const RunListing& run, const WeatherSummary& weather);
std::string layers_json_text(const RunListing& run, const std::vector<WeatherSummary>& frames);
std::string xplane_text(const RunListing& run, const std::vector<WeatherSummary>& frames);
std::string wpr_text(const RunListing& run, const WeatherSummary& weather);

// Returns the genus of a layer: that which it was given; by its name, "Sc1" of a scene that was made of a report; of its
// veil's form or its models; "" where none tells.
std::string genus_of(const Scene& scene, std::size_t layer);

// Returns a sentence where the scene does not say how high its origin is above mean sea level, else "": heights of all
// formats are then above the ellipsoid.
std::string datum_note(const Scene& scene);

// Returns the true bearing that a velocity of the world comes from, 0..360.
double bearing_from(const Velocity& velocity, double heading_deg);

// Returns CIGI 3.3 packets, big-endian; and all frames as a capture of UDP datagrams to port 8005 (pcap, Ethernet). Every
// frame has all that this program ever sends, so that nothing of a frame before stays: IG Control; Environmental Region
// Control, which makes the region of a scene with a place and destroys it without one; Weather Control of the ground fog
// and of three layers of clouds, of that region or global, switched off where there is none.
std::vector<std::byte> cigi_packets(const WeatherSummary& weather);
std::vector<std::byte> cigi_capture(const std::vector<WeatherSummary>& frames);

// Returns at most three layers: the two nearest are merged until so many are left.
std::vector<LayerSummary> three_layers(std::vector<LayerSummary> layers);

// Returns the number of winds of X-Plane's structure, and at most so many of a profile: the lowest, the highest and those
// evenly between them.
inline constexpr std::size_t kXplaneWinds = 13;
std::vector<std::pair<double, Velocity>> xplane_winds(const std::vector<std::pair<double, Velocity>>& wind);

// Returns what the limits of `formats` leave out of the frames, a sentence each.
std::vector<std::string> limit_notes(const std::vector<WeatherFormat>& formats,
                                     const std::vector<WeatherSummary>& frames);

}  // namespace nephos
