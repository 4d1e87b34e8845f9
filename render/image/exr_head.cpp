// SPDX-License-Identifier: Apache-2.0
#include "render/image/exr_head.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

#include <sys/types.h>
#include <unistd.h>

#include "density/vdb/sandbox.h"

namespace nephos {
namespace {

constexpr std::uint32_t kMagic = 20000630, kDeep = 1u << 11, kMultipart = 1u << 12;
constexpr std::uint8_t kCompressions = 10;

// Goes over the head of a file.
class HeadBytes {
  public:
    explicit HeadBytes(ExrSource& source) : source_(source) {}

    std::uint64_t place() const { return at_; }
    char next() {
        if (at_ - begin_ >= filled_) fill();
        return buffer_[at_++ - begin_];
    }
    std::uint32_t number() {
        std::uint32_t value = 0;
        for (int n = 0; n < 4; ++n) value |= std::uint32_t(std::uint8_t(next())) << (8 * n);
        return value;
    }
    std::array<std::int32_t, 4> window() {
        std::array<std::int32_t, 4> numbers{};
        for (std::int32_t& one : numbers) one = std::int32_t(number());
        return numbers;
    }
    std::string text() {
        std::string found;
        while (const char c = next()) {
            found += c;
            if (found.size() > 255) throw std::runtime_error("its head has a name of more than 255 bytes");
        }
        return found;
    }
    void go_to(std::uint64_t place) { at_ = place; }

  private:
    void fill() {
        const std::int64_t got = read_exr_bytes(source_, buffer_.data(), buffer_.size(), at_);
        if (got < 0) throw_exr_failure(source_.failure);
        if (got == 0) throw std::runtime_error("it ends early");
        begin_ = at_;
        filled_ = std::uint64_t(got);
    }

    ExrSource& source_;
    std::array<char, 4096> buffer_{};
    std::uint64_t at_ = 0, begin_ = 0, filled_ = 0;
};

struct Attribute {
    std::string name, type;
    std::uint32_t size = 0;  // of the value, bytes
};

// Calls `visit` for each attribute of a part whose first one is called `name`; it may read the value.
template <typename Visit>
void each_attribute(HeadBytes& head, std::string name, Visit&& visit) {
    for (; !name.empty(); name = head.text()) {
        Attribute attribute{name, head.text(), 0};
        attribute.size = head.number();
        const std::uint64_t end = head.place() + attribute.size;
        visit(attribute);
        head.go_to(end);
    }
}

struct Needed {
    std::string_view name, type;
    std::uint32_t size = 0;  // 0: any
    int count = 0;
};

void require_form(const Attribute& found, Needed& needed) {
    if (found.type != needed.type || (needed.size != 0 && found.size != needed.size))
        throw std::runtime_error("its " + found.name + " is not of the type " + std::string(needed.type));
    if (++needed.count > 1) throw std::runtime_error("its head has two of " + found.name);
}

}  // namespace

std::int64_t read_exr_bytes(ExrSource& source, void* to, std::uint64_t size, std::uint64_t from) {
    if (from >= source.size) return 0;
    std::uint64_t done = 0;
    while (done < size) {
        const ssize_t got =
            ::pread(source.fd, static_cast<char*>(to) + done, size - done, off_t(from + done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) source.failure = errno;
        if (got < 0) return -1;
        if (got == 0) break;
        done += std::uint64_t(got);
    }
    return std::int64_t(done);
}

void throw_exr_failure(int failure) {
    throw std::runtime_error(std::string(kCannotRead) + std::strerror(failure));
}

ExrHead read_exr_head(ExrSource& source) {
    std::array<Needed, 4> needed{{{"channels", "chlist"},
                                  {"compression", "compression", 1},
                                  {"dataWindow", "box2i", 16},
                                  {"displayWindow", "box2i", 16}}};
    HeadBytes bytes(source);
    if (bytes.number() != kMagic) throw std::runtime_error("it is no EXR file");
    const std::uint32_t flags = bytes.number();
    if ((flags & kDeep) != 0) throw std::runtime_error("it holds deep data");
    ExrHead head;
    head.is_multipart = (flags & kMultipart) != 0;
    each_attribute(bytes, bytes.text(), [&](const Attribute& attribute) {
        const auto found = std::ranges::find(needed, attribute.name, &Needed::name);
        if (found == needed.end()) return;
        require_form(attribute, *found);
        if (attribute.name == "compression") head.compression = std::uint8_t(bytes.next());
        if (attribute.name == "dataWindow") head.data_window = bytes.window();
        if (attribute.name == "displayWindow") head.display_window = bytes.window();
    });
    for (const Needed& one : needed)
        if (one.count == 0) throw std::runtime_error("its head has no " + std::string(one.name));
    if (head.compression >= kCompressions)
        throw std::runtime_error("its compression is " + std::to_string(head.compression) +
                                 ", which is none");
    // Heads of other parts follow, to one that begins with its end.
    for (std::string name; head.is_multipart && !(name = bytes.text()).empty();)
        each_attribute(bytes, name, [](const Attribute&) {});
    head.table_at = bytes.place();
    return head;
}

}  // namespace nephos
