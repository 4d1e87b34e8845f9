// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <locale>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <OpenEXR/ImfBoxAttribute.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompression.h>
#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <fcntl.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "density/vdb/sandbox.h"
#include "render/image/image_file.h"

namespace nephos {
namespace {

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

// Throws what was thrown while `what` was done, as one message.
[[noreturn]] void rethrow(const std::string& what, const std::exception& reason) {
    if (std::string_view(reason.what()).starts_with(kCannotRead)) throw std::runtime_error(reason.what());
    throw std::runtime_error("cannot read " + what + ": " + reason.what());
}

// An open file, for a process that may open none.
class OpenFile : public Imf::IStream {
  public:
    OpenFile(int fd, const std::filesystem::path& path) : Imf::IStream(path.c_str()), fd_(fd), size_(::lseek(fd, 0, SEEK_END)) {}
    bool read(char to[], int size) override {
        for (int done = 0; done < size;) {
            if (at_ < begin_ || at_ >= begin_ + filled_) fill();
            const std::uint64_t from = at_ - begin_;
            const auto some = std::size_t(std::min<std::uint64_t>(filled_ - from, std::uint64_t(size - done)));
            std::memcpy(to + done, &buffer_[from], some);
            done += int(some);
            at_ += some;
        }
        return off_t(at_) < size_;
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t to) override { at_ = to; }

  private:
    void fill() {
        ssize_t got = 0;
        while (at_ < std::uint64_t(size_)) {  // a place that a damaged file names may be no off_t
            got = ::pread(fd_, buffer_.data(), buffer_.size(), off_t(at_));
            if (got >= 0 || errno != EINTR) break;
        }
        if (got < 0) throw std::runtime_error(std::string(kCannotRead) + std::strerror(errno));
        if (got == 0) throw std::runtime_error("it ends early");
        begin_ = at_;
        filled_ = std::uint64_t(got);
    }

    int fd_;
    off_t size_;
    std::uint64_t at_ = 0, begin_ = 0, filled_ = 0;  // place in the file; part of it in the buffer
    std::vector<char> buffer_ = std::vector<char>(65536);
};

void send(SandboxWriter& writer, const ExrPart& part) {
    writer.text(part.name);
    writer.value(part.width);
    writer.value(part.height);
    writer.value(std::uint8_t(part.complete));
    writer.text(part.compression);
    writer.value(part.channels.size());
    for (const ExrChannel& channel : part.channels) {
        writer.text(channel.name);
        writer.text(channel.type);
    }
    writer.value(part.attributes.size());
    for (const auto& [name, text] : part.attributes) {
        writer.text(name);
        writer.text(text);
    }
}

ExrPart received(SandboxReader& reader) {
    ExrPart part;
    part.name = reader.text();
    part.width = reader.value<int>();
    part.height = reader.value<int>();
    part.complete = reader.value<std::uint8_t>() != 0;
    part.compression = reader.text();
    for (auto left = reader.value<std::size_t>(); left > 0; --left) {
        ExrChannel& channel = part.channels.emplace_back();
        channel.name = reader.text();
        channel.type = reader.text();
    }
    for (auto left = reader.value<std::size_t>(); left > 0; --left) {
        auto& [name, text] = part.attributes.emplace_back();
        name = reader.text();
        text = reader.text();
    }
    return part;
}

}  // namespace

ExrInfo read_exr_info(const std::filesystem::path& path) {
    constexpr SandboxLimits kLimits{.seconds = 60, .memory_bytes = std::size_t{1} << 30, .most_bytes = 16u << 20};
    const Descriptor opened = open_regular_file(path, O_RDONLY);
    const int kept[] = {opened.get()};
    ExrInfo info;
    Imf::staticInitialize();  // before the fork, so that the child finds it done
    run_sandboxed(
        path, "OpenEXR", kLimits, kept,
        [&](SandboxWriter& writer) {
            try {
                OpenFile stream(opened.get(), path);
                const Imf::MultiPartInputFile file(stream, 0);  // no threads
                writer.value(file.parts());
                for (int i = 0; i < file.parts(); ++i) {
                    ExrPart part = describe(file.header(i));
                    part.complete = file.partComplete(i);
                    send(writer, part);
                }
            } catch (const std::bad_alloc&) {
                throw;
            } catch (const std::exception& reason) {
                rethrow("OpenEXR", reason);
            }
        },
        [&](SandboxReader& reader) {
            info.parts.clear();
            for (int left = reader.value<int>(); left > 0; --left) info.parts.push_back(received(reader));
        });
    return info;
}

}  // namespace nephos
