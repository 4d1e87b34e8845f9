// SPDX-License-Identifier: Apache-2.0
#include <iterator>

#include "simulation/export/export.h"

namespace nephos {
namespace {

void set_type(ExportOptions& o, VoxelType type) { o.type = o.type.value_or(type); }

void add_format(ExportOptions& o, ExportFormat format) {
    if (o.formats.empty()) o.formats = {format};
}

void blender(ExportOptions& o) {
    add_format(o, ExportFormat::vdb);
    set_type(o, VoxelType::r32f);
    o.half_voxel_shift = true;
    if (o.velocity_name.empty()) o.velocity_name = "velocity";
}

void unreal(ExportOptions& o) {
    add_format(o, ExportFormat::vdb);
    set_type(o, VoxelType::r16f);
    o.limit_side = 2048;
}

void unity(ExportOptions& o) {
    add_format(o, ExportFormat::slices);
    set_type(o, VoxelType::r8);
    o.layout.axes = AxisOrder::unity;
    if (o.layout.border == Border::none) o.layout.border = Border::zero;
    o.limit_side = 2048;
}

void omniverse(ExportOptions& o) {
    add_format(o, ExportFormat::usd);
    set_type(o, VoxelType::r32f);
}

void paraview(ExportOptions& o) {
    add_format(o, ExportFormat::vti);
    set_type(o, VoxelType::r32f);
    o.zip = true;
}

void vulkan(ExportOptions& o) {
    add_format(o, ExportFormat::ktx2);
    set_type(o, VoxelType::bc4);
    o.mips = true;
    if (o.layout.border == Border::none) o.layout.border = Border::zero;
    o.limit_side = 2048;
}

void xplane(ExportOptions& o) { o.weather.push_back(WeatherFormat::xplane); }
void msfs(ExportOptions& o) { o.weather.push_back(WeatherFormat::wpr); }
void cigi(ExportOptions& o) { o.weather.push_back(WeatherFormat::cigi); }
void flightgear(ExportOptions& o) {
    add_format(o, ExportFormat::flightgear);
    o.weather.push_back(WeatherFormat::metar);
}

constexpr const char* kXplane =
    "X-Plane 12 (not tried in X-Plane; report what differs)\n\n"
    "Read {NAME}.xplane.json in a plug-in: each frame has the fields of XPLMWeatherInfo_t (up to three cloud "
    "layers, heights\n"
    "in metres MSL, winds with true bearings). Give them to XPLMSetWeatherAtLocation.\n";

constexpr const char* kMsfs =
    "Microsoft Flight Simulator (not tried in MSFS; report what differs)\n\n"
    "Copy {NAME}.wpr into the folder WeatherPresets of a package of yours, or into\n"
    "%APPDATA%/Microsoft Flight Simulator/Weather/Presets, and choose it under Weather.\n";

constexpr const char* kCigi =
    "CIGI 3.3 (packets decoded by Wireshark's dissector)\n\n"
    "{NAME}.cigi has the packets of all frames, one message after the other, each from its IG Control on.\n\n"
    "{NAME}.pcap has them as a datagram a frame: IG Control, then Weather Control of the ground fog (layer 0) and of "
    "three "
    "layers of\n"
    "clouds (1 to 3), big-endian; what is not there is switched off. They are of region 1 around the scene's "
    "place "
    "(Environmental\n"
    "Region Control) where it has a [georeference], else global, and region 1 is destroyed. Heights are "
    "above mean sea "
    "level if\n"
    "the scene says where that is. Play it with tcpreplay, or take the payloads as they are.\n";

constexpr const char* kFlightgear =
    "FlightGear (not tried in FlightGear; report what differs)\n\n"
    "The weather, all versions: fgfs --metar=\"$(head -n 1 {NAME}.metar.txt)\" with the aerodrome's letters where "
    "it has ZZZZ.\n\n"
    "A cloud, versions after 2024: {FIRST} is the largest cloud of its frame. Copy it into Textures/Sky of the "
    "data\n"
    "folder, and name it as a <voxel-texture> of a cloud in Environment/cloudlayers.xml. A voxel of the picture is "
    "drawn as\n"
    "large as FlightGear's own voxels, whatever it was here: choose --voxel so that they agree. Green is the type "
    "(0\n"
    "wispy, 1 billowy), blue the density; FlightGear computes the rest, and turns clouds at random.\n";

constexpr const char* kBlender =
    "Blender (tried in 3.4)\n\n"
    "1. Add > Volume > Import OpenVDB, and choose all VDB files of this folder (key A): they become one "
    "sequence of {COUNT}\n"
    "   frames, files from number {START} on: the scene's frame 1 shows the first, and beyond the last there is nothing\n"
    "   to see (Properties > Object Data > File). {FIRST} alone is a still.\n"
    "2. Leave location, rotation and scale as they are: the file is in metres, z up, at its place in the "
    "world.\n"
    "3. The view ends at 1,000 m: set View > Sidebar > View > End to 100000 m, and the camera's Clip End "
    "too.\n"
    "4. Shading: a new material with Principled Volume; Density Attribute `density`, Density {EXTINCTION}, "
    "Colour white,\n"
    "   Anisotropy 0.6. Density is the extinction coefficient per metre where the voxels are 1.\n"
    "5. Render properties > Volumes > Step Rate 1 (Cycles), Light Paths > Max Bounces > Volume 8 or more: with 0, as it\n"
    "   is set, clouds are nearly black. Motion blur: Object Data > Velocity Grid "
    "`velocity`, Velocity\n"
    "   Scale {VELOCITY_SCALE}.\n\n"
    "Half a voxel. Cycles of Blender 3.4 draws every VDB file half a voxel too far along +x, +y and +z. "
    "These files are\n"
    "moved by {SHIFT} m on each axis to compensate. If your version draws them half a voxel too low and "
    "left, export\n"
    "with --to vdb instead of --for blender.\n";

constexpr const char* kUnreal =
    "Unreal Engine 5.3 or newer, Sparse Volume Textures (not tried in Unreal; report what differs)\n\n"
    "1. Content Browser > Import: choose {FIRST} alone; files of one folder with rising numbers are taken as "
    "one animated\n"
    "   texture. Attributes A: `density`, format Unorm8 or Float16.\n"
    "2. Add a Heterogeneous Volume with a Volume-domain material that samples the texture; Extinction = "
    "density times\n"
    "   {EXTINCTION} per metre. One unit of Unreal is a centimetre: multiply by 0.01 where the material "
    "counts in them.\n"
    "3. The importer applies the file's transform; it is right-handed and Unreal left-handed, so check that "
    "east stays east\n"
    "   with the sidecar's min_m and max_m. Scale the actor by 100 (metres to centimetres).\n";

constexpr const char* kUnity =
    "Unity, 3-D textures (not tried in Unity; report what differs)\n\n"
    "1. Import {FIRST} as a Texture 2D with Texture Shape 3D, Columns {COLUMNS}, Rows {ROWS}; no mip maps, "
    "no sRGB, Wrap\n"
    "   Mode Clamp, Format R 8. Slices are already in Unity's order: x east, y up, z north, left-handed.\n"
    "2. Place a Local Volumetric Fog or your own ray marcher, in metres, from min_m of the sidecar to "
    "{TEXTURE_END}.\n"
    "3. Extinction per metre = texture * {SCALE} * {EXTINCTION}.\n"
    "The border of zeros lets clamped addresses read nothing.\n";

constexpr const char* kOmniverse =
    "Omniverse, usdview, Houdini, Blender from 4.0 (USD text parsed by tinyusdz; not tried in Omniverse)\n\n"
    "Open {NAME}.usda. It references the VDB files beside it; metres, z up, frame {START} to {END}.\n"
    "Give the Volume a material whose density is multiplied by {EXTINCTION} per metre.\n";

constexpr const char* kParaview =
    "ParaView and VTK (read by VTK 9.1)\n\n"
    "1. Open {NAME}.pvd: all frames with their times in seconds. Or a single {FIRST}.\n"
    "2. Representation Volume, colour by `density`. Extinction per metre = density * {EXTINCTION}.\n"
    "Points are the centres of voxels, in metres, z up.\n";

constexpr const char* kVulkan =
    "Vulkan, Direct3D and other engines that load KTX 2\n\n"
    "Upload {FIRST} as a 3-D image with all levels (libktx, or the 100 lines of the specification). The key "
    "`nephos` of each\n"
    "file is the sidecar's text, but for what is of frames, times and wind. Address mode clamp to edge: the "
    "border is 0. Value = texel * {SCALE}; "
    "extinction per metre\n"
    "= value * {EXTINCTION}. World place: min_m .. max_m of the sidecar.\n";

}  // namespace

const std::vector<NamedFormat>& export_formats() {
    static const std::vector<NamedFormat> formats{
        {ExportFormat::raw, "raw", ".raw", "little-endian voxels alone"},
        {ExportFormat::vti, "vti", ".vti", "VTK ImageData, with a .pvd of all times"},
        {ExportFormat::dds, "dds", ".dds", "DirectDraw volume texture"},
        {ExportFormat::ktx2, "ktx2", ".ktx2", "Khronos texture"},
        {ExportFormat::nvdb, "nvdb", ".nvdb", "NanoVDB"},
        {ExportFormat::usd, "usd", ".usda", "USD scene of VDB files"},
        {ExportFormat::slices, "slices", ".png", "flipbook of slices"},
        {ExportFormat::vdb, "vdb", ".vdb", "OpenVDB with names of a flat folder"},
        {ExportFormat::bricks, "bricks", ".bricks",
         "bricks with a border, a table of ranges, nothing where it is empty"},
        {ExportFormat::flightgear, "flightgear", ".voxels.png", "the largest cloud as FlightGear's picture of voxels"},
    };
    return formats;
}

const std::vector<NamedWeather>& weather_formats() {
    static const std::vector<NamedWeather> formats{
        {WeatherFormat::layers, "layers", ".layers.json", "layers of clouds: base, top, cover, wind, rain"},
        {WeatherFormat::metar, "metar", ".metar.txt", "a METAR a frame"},
        {WeatherFormat::xplane, "xplane", ".xplane.json", "X-Plane 12, XPLMWeatherInfo_t"},
        {WeatherFormat::wpr, "wpr", ".wpr", "MSFS weather preset, first frame"},
        {WeatherFormat::cigi, "cigi", ".pcap", "CIGI 3.3 packets: a file of them, and a capture of UDP"},
    };
    return formats;
}

const std::vector<ExportPreset>& export_presets() {
    static const std::vector<ExportPreset> presets{
        {"blender", "VDB, moved by half a voxel for Cycles", &blender, kBlender},
        {"unreal", "VDB of 16-bit floats for Sparse Volume Textures", &unreal, kUnreal},
        {"unity", "flipbook of slices, x east, y up, z north", &unity, kUnity},
        {"omniverse", "USD", &omniverse, kOmniverse},
        {"paraview", "VTI and PVD", &paraview, kParaview},
        {"xplane", "cloud and wind layers as XPLMWeatherInfo_t", &xplane, kXplane},
        {"msfs", "weather preset (.wpr)", &msfs, kMsfs},
        {"cigi", "CIGI 3.3 packets", &cigi, kCigi},
        {"flightgear", "METAR", &flightgear, kFlightgear},
        {"vulkan", "KTX 2, BC4, levels, border of zeros", &vulkan, kVulkan},
    };
    return presets;
}

}  // namespace nephos
