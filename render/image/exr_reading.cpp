// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>
#include <string>

#include <OpenEXR/ImfBoxAttribute.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompression.h>
#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include "core/error.h"
#include "render/image/image_file.h"

namespace nephos {
namespace {

constexpr int kMaxSide = 65536;  // no file of ours is larger; a damaged header often claims to be

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": cannot read OpenEXR: " + reason.substr(0, 300));
}

std::string compression_name(Imf::Compression compression) {
    switch (compression) {
        case Imf::NO_COMPRESSION:
            return "none";
        case Imf::RLE_COMPRESSION:
            return "rle";
        case Imf::ZIPS_COMPRESSION:
            return "zips";
        case Imf::ZIP_COMPRESSION:
            return "zip";
        case Imf::PIZ_COMPRESSION:
            return "piz";
        case Imf::PXR24_COMPRESSION:
            return "pxr24";
        case Imf::B44_COMPRESSION:
            return "b44";
        case Imf::B44A_COMPRESSION:
            return "b44a";
        case Imf::DWAA_COMPRESSION:
            return "dwaa";
        case Imf::DWAB_COMPRESSION:
            return "dwab";
        default:
            return "unknown";
    }
}

template <class Typed>
const Typed* as(const Imf::Attribute& attribute) {
    return dynamic_cast<const Typed*>(&attribute);
}

// Numbers with `digits` significant digits, separated by blanks.
template <class... Values>
std::string joined(int digits, Values... values) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text.precision(digits);
    const char* separator = "";
    ((text << separator << values, separator = " "), ...);
    return text.str();
}

std::string matrix_text(const Imath::M44f& m) {
    const auto row = [&](int i) { return joined(9, m[i][0], m[i][1], m[i][2], m[i][3]); };
    return joined(9, row(0), row(1), row(2), row(3));
}

std::string attribute_text(const Imf::Attribute& attribute) {
    if (const auto* text = as<Imf::StringAttribute>(attribute)) return text->value();
    if (const auto* number = as<Imf::FloatAttribute>(attribute)) return joined(9, number->value());
    if (const auto* number = as<Imf::DoubleAttribute>(attribute)) return joined(17, number->value());
    if (const auto* number = as<Imf::IntAttribute>(attribute)) return joined(9, number->value());
    if (const auto* ratio = as<Imf::RationalAttribute>(attribute))
        return joined(9, ratio->value().n) + "/" + joined(9, ratio->value().d);
    if (const auto* v = as<Imf::V2fAttribute>(attribute)) return joined(9, v->value().x, v->value().y);
    if (const auto* v = as<Imf::V3fAttribute>(attribute))
        return joined(9, v->value().x, v->value().y, v->value().z);
    if (const auto* box = as<Imf::Box2iAttribute>(attribute))
        return joined(9, box->value().min.x, box->value().min.y, box->value().max.x, box->value().max.y);
    if (const auto* matrix = as<Imf::M44fAttribute>(attribute)) return matrix_text(matrix->value());
    return std::string("<") + attribute.typeName() + ">";
}

// Returns true for attributes that other fields of ExrPart contain.
bool is_structural(const std::string& name) {
    for (const char* known :
         {"channels", "compression", "dataWindow", "displayWindow", "lineOrder", "name", "pixelAspectRatio",
          "screenWindowCenter", "screenWindowWidth", "type", "chunkCount", "tiles", "version"})
        if (name == known) return true;
    return false;
}

ExrPart describe(const Imf::Header& header) {
    ExrPart part;
    if (header.hasName()) part.name = header.name();
    const Imath::Box2i window = header.dataWindow();
    part.width = window.max.x - window.min.x + 1;
    part.height = window.max.y - window.min.y + 1;
    part.compression = compression_name(header.compression());
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
        const Imf::PixelType type = c.channel().type;
        part.channels.push_back({c.name(), type == Imf::HALF    ? "half"
                                           : type == Imf::FLOAT ? "float"
                                                                : "uint"});
    }
    for (auto a = header.begin(); a != header.end(); ++a)
        if (!is_structural(a.name())) part.attributes.emplace_back(a.name(), attribute_text(a.attribute()));
    return part;
}

// Checked before anything is allocated for the pixels.
void require_layers(const std::filesystem::path& path, const Imf::MultiPartInputFile& file) {
    if (file.parts() < 2) fail(path, "expected the parts \"picture\" and \"shadow\"");
    const auto require = [&](int part, const char* channel) {
        const Imf::Channel* found = file.header(part).channels().findChannel(channel);
        if (found == nullptr || found->type != Imf::FLOAT || found->xSampling != 1 || found->ySampling != 1)
            fail(path, std::string("no 32-bit channel ") + channel);
    };
    for (const char* channel : {"beauty.R", "beauty.G", "beauty.B", "transmittance.Y", "depth.Z"})
        require(0, channel);
    require(1, "shadow.Y");
    for (int part = 0; part < 2; ++part) {
        if (file.header(part).type() != Imf::SCANLINEIMAGE) fail(path, "expected scan lines, not tiles");
        if (!file.partComplete(part)) fail(path, "incomplete file");
        const Imath::Box2i window = file.header(part).dataWindow();
        const Imath::V2i size = window.size();
        if (window.min != Imath::V2i(0, 0) || size.x < 0 || size.y < 0 || size.x >= kMaxSide ||
            size.y >= kMaxSide)
            fail(path, "unexpected data window");
        if (part == 1 && size.x != size.y) fail(path, "the shadow map is not square");
    }
}

void read_part(Imf::MultiPartInputFile& file, int number, const Imf::FrameBuffer& buffer, int height) {
    Imf::InputPart part(file, number);
    part.setFrameBuffer(buffer);
    part.readPixels(0, height - 1);
}

char* base_of(float* values) { return reinterpret_cast<char*>(values); }

Vec3 vector_attribute(const Imf::Header& header, const char* name) {
    const auto* attribute = header.findTypedAttribute<Imf::V3fAttribute>(name);
    if (attribute == nullptr) return {};
    return {attribute->value().x, attribute->value().y, attribute->value().z};
}

Picture read_layers(const std::filesystem::path& path) {
    Imf::MultiPartInputFile file(path.c_str());
    require_layers(path, file);
    Picture picture;
    const Imath::V2i size = file.header(0).dataWindow().size();
    picture.width = size.x + 1;
    picture.height = size.y + 1;
    picture.shadow_size = file.header(1).dataWindow().size().x + 1;
    picture.beauty.resize(3 * picture.pixels());
    picture.transmittance.resize(picture.pixels());
    picture.depth_m.resize(picture.pixels());
    picture.shadow.resize(std::size_t(picture.shadow_size) * std::size_t(picture.shadow_size));

    const std::size_t row = sizeof(float) * std::size_t(picture.width);
    Imf::FrameBuffer buffer;
    const char* names[3] = {"beauty.R", "beauty.G", "beauty.B"};
    for (std::size_t c = 0; c < 3; ++c)
        buffer.insert(names[c],
                      Imf::Slice(Imf::FLOAT, base_of(picture.beauty.data() + c), 3 * sizeof(float), 3 * row));
    buffer.insert("transmittance.Y",
                  Imf::Slice(Imf::FLOAT, base_of(picture.transmittance.data()), sizeof(float), row));
    buffer.insert("depth.Z", Imf::Slice(Imf::FLOAT, base_of(picture.depth_m.data()), sizeof(float), row));
    read_part(file, 0, buffer, picture.height);

    Imf::FrameBuffer shadow;
    shadow.insert("shadow.Y", Imf::Slice(Imf::FLOAT, base_of(picture.shadow.data()), sizeof(float),
                                         sizeof(float) * std::size_t(picture.shadow_size)));
    read_part(file, 1, shadow, picture.shadow_size);
    const Imf::Header& header = file.header(1);
    picture.shadow_frame = {vector_attribute(header, "shadowOrigin"), vector_attribute(header, "shadowU"),
                            vector_attribute(header, "shadowV"), vector_attribute(header, "shadowDirection")};
    return picture;
}

}  // namespace

ExrInfo read_exr_info(const std::filesystem::path& path) {
    try {
        const Imf::MultiPartInputFile file(path.c_str());
        ExrInfo info;
        for (int i = 0; i < file.parts(); ++i) {
            info.parts.push_back(describe(file.header(i)));
            info.parts.back().complete = file.partComplete(i);
        }
        return info;
    } catch (const Error&) {
        throw;
    } catch (const std::exception& reason) {
        fail(path, reason.what());
    }
}

Picture read_exr(const std::filesystem::path& path) {
    try {
        return read_layers(path);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& reason) {
        fail(path, reason.what());
    }
}

}  // namespace nephos
