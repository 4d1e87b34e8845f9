// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <glm/gtc/type_ptr.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "render/image/checked_stream.h"
#include "render/image/image_file.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

constexpr const char* kBeauty[3] = {"beauty.R", "beauty.G", "beauty.B"};
constexpr const char* kDefault[3] = {"R", "G", "B"};

void add_metadata(Imf::Header& header, const PictureMetadata& metadata) {
    const auto text = [&](const char* name, const std::string& value) {
        if (!value.empty()) header.insert(name, Imf::StringAttribute(value));
    };
    text("scene", metadata.scene);
    text("seed", std::to_string(metadata.seed));  // as text: the format has no 64-bit integer
    text("sceneHash", metadata.scene_hash);
    text("stateHash", metadata.state_hash);
    text("nephosVersion", metadata.version);
    text("backend", metadata.backend);
    text("device", metadata.device);
    header.insert("time", Imf::DoubleAttribute(metadata.time_s));
    if (metadata.extinction_per_m > 0)
        header.insert("extinctionPerMetre", Imf::DoubleAttribute(metadata.extinction_per_m));
}

Imath::V3f to_imath(const Vec3& v) { return {float(v.x), float(v.y), float(v.z)}; }

Imf::Header picture_header(const Picture& picture, const RenderOptions& options,
                           const PictureMetadata& metadata) {
    Imf::Header header(picture.width, picture.height);
    header.setName("picture");
    header.setType(Imf::SCANLINEIMAGE);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (int c = 0; c < 3; ++c) {
        header.channels().insert(kDefault[c], Imf::Channel(Imf::HALF));
        header.channels().insert(kBeauty[c], Imf::Channel(Imf::FLOAT));
    }
    header.channels().insert("transmittance.Y", Imf::Channel(Imf::FLOAT));
    header.channels().insert("depth.Z", Imf::Channel(Imf::FLOAT));
    Imf::addChromaticities(header, Imf::Chromaticities());  // the default is Rec. 709
    Imath::M44f matrix;
    std::memcpy(matrix.getValue(), glm::value_ptr(world_to_camera(camera_frame(options.camera))),
                sizeof matrix);
    Imf::addWorldToCamera(header, matrix);
    if (metadata.frames_per_second > 0) {
        Imf::addFramesPerSecond(
            header,
            Imf::Rational(int(std::lround(1000.0 * std::min(metadata.frames_per_second, 1e6))), 1000));
        header.insert("timeScale", Imf::DoubleAttribute(metadata.time_scale));
    }
    header.insert("verticalFieldOfView", Imf::FloatAttribute(float(options.camera.vertical_fov_deg)));
    header.insert("exposure", Imf::FloatAttribute(float(options.camera.exposure_ev)));
    add_metadata(header, metadata);
    return header;
}

Imf::Header shadow_header(const Picture& picture, const PictureMetadata& metadata) {
    // All parts of a file must share display window and chromaticities; the size is in the data window.
    Imf::Header header(picture.width, picture.height);
    const int last = picture.shadow_size - 1;
    header.dataWindow() = Imath::Box2i(Imath::V2i(0, 0), Imath::V2i(last, last));
    Imf::addChromaticities(header, Imf::Chromaticities());
    header.setName("shadow");
    header.setType(Imf::SCANLINEIMAGE);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.channels().insert("shadow.Y", Imf::Channel(Imf::FLOAT));
    const ShadowFrame& frame = picture.shadow_frame;
    header.insert("shadowOrigin", Imf::V3fAttribute(to_imath(frame.origin_m)));
    header.insert("shadowU", Imf::V3fAttribute(to_imath(frame.u_axis_m)));
    header.insert("shadowV", Imf::V3fAttribute(to_imath(frame.v_axis_m)));
    header.insert("shadowDirection", Imf::V3fAttribute(to_imath(frame.direction)));
    add_metadata(header, metadata);
    return header;
}

// The library takes a char* for reading, too.
char* base_of(const float* values) { return const_cast<char*>(reinterpret_cast<const char*>(values)); }

void write_picture_part(Imf::MultiPartOutputFile& file, const Picture& picture) {
    Imf::OutputPart part(file, 0);
    const std::size_t row = sizeof(float) * std::size_t(picture.width);
    std::vector<half> half_row(3 * std::size_t(picture.width));
    Imf::FrameBuffer buffer;
    for (int c = 0; c < 3; ++c) {
        const std::size_t channel = std::size_t(c);
        // A row stride of 0: the one row of halves is filled anew for every line.
        buffer.insert(kDefault[c], Imf::Slice(Imf::HALF, reinterpret_cast<char*>(&half_row[channel]),
                                              3 * sizeof(half), 0));
        buffer.insert(kBeauty[c], Imf::Slice(Imf::FLOAT, base_of(picture.beauty.data() + channel),
                                             3 * sizeof(float), 3 * row));
    }
    buffer.insert("transmittance.Y",
                  Imf::Slice(Imf::FLOAT, base_of(picture.transmittance.data()), sizeof(float), row));
    buffer.insert("depth.Z", Imf::Slice(Imf::FLOAT, base_of(picture.depth_m.data()), sizeof(float), row));
    part.setFrameBuffer(buffer);
    for (int y = 0; y < picture.height; ++y) {
        const float* line = picture.beauty.data() + 3 * std::size_t(y) * std::size_t(picture.width);
        for (std::size_t i = 0; i < half_row.size(); ++i)
            half_row[i] = half(std::clamp(line[i], -65504.0f, 65504.0f));
        part.writePixels(1);
    }
}

void write_shadow_part(Imf::MultiPartOutputFile& file, const Picture& picture) {
    Imf::OutputPart part(file, 1);
    Imf::FrameBuffer buffer;
    buffer.insert("shadow.Y", Imf::Slice(Imf::FLOAT, base_of(picture.shadow.data()), sizeof(float),
                                         sizeof(float) * std::size_t(picture.shadow_size)));
    part.setFrameBuffer(buffer);
    part.writePixels(picture.shadow_size);
}

void require_complete(const std::filesystem::path& file) {
    Imf::MultiPartInputFile input(file.c_str());
    for (int part = 0; part < input.parts(); ++part)
        if (!input.partComplete(part)) throw std::runtime_error("it is incomplete, as for want of memory");
}

void check_shape(const Picture& picture) {
    const std::size_t shadow_texels = std::size_t(picture.shadow_size) * std::size_t(picture.shadow_size);
    if (picture.width < 1 || picture.height < 1 || picture.shadow_size < 1 ||
        picture.beauty.size() != 3 * picture.pixels() || picture.transmittance.size() != picture.pixels() ||
        picture.depth_m.size() != picture.pixels() || picture.shadow.size() != shadow_texels)
        throw Error(ErrorCode::usage, "picture: its layers do not have the size that it states");
}

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what,
                       const std::exception& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + reason.what());
}

}  // namespace

void write_exr(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata) {
    check_shape(picture);
    const Imf::Header headers[2] = {picture_header(picture, options, metadata),
                                    shadow_header(picture, metadata)};
    write_atomically(path, [&](const std::filesystem::path& temporary) {
        // Writes that fail are Errors; what else fails in the library is memory, of its compression above all.
        const char* what = "cannot write OpenEXR (as for want of memory)";
        try {
            CheckedStream stream(temporary, path);
            {
                Imf::MultiPartOutputFile file(stream, headers, 2);
                write_picture_part(file, picture);
                write_shadow_part(file, picture);
            }
            stream.close();
            what = "cannot read the OpenEXR file that was written";
            require_complete(temporary);
        } catch (const Error&) {
            throw;
        } catch (const std::bad_alloc&) {
            throw;
        } catch (const std::exception& reason) {
            fail(path, what, reason);
        }
    });
}

}  // namespace nephos
