// SPDX-License-Identifier: Apache-2.0
#include <locale>
#include <sstream>
#include <string>

#include <OpenEXR/ImfBoxAttribute.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompression.h>
#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include "core/error.h"
#include "render/image/image_file.h"

namespace nephos {
namespace {

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

}  // namespace nephos
