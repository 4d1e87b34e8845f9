// SPDX-License-Identifier: Apache-2.0
#include "apps/python/arrays.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "apps/python/released_lock.h"
#include "core/error.h"
#include "core/text.h"

namespace py = pybind11;

namespace nephos {
namespace {

// An array over memory that `owner` holds: who takes it holds the owner, and nobody can make it writable.
template <typename T, typename Owner>
py::array owned_array(const T* data, std::vector<py::ssize_t> shape, Owner owner) {
    auto held = std::make_unique<Owner>(std::move(owner));
    const py::capsule capsule(held.get(), [](void* pointer) { delete static_cast<Owner*>(pointer); });
    held.release();
    py::array_t<T> array(std::move(shape), data, capsule);
    array.attr("setflags")(py::arg("write") = false);
    return array;
}

template <typename T>
py::array vector_array(std::vector<T> values, std::vector<py::ssize_t> shape) {
    auto owner = std::make_shared<const std::vector<T>>(std::move(values));
    const T* data = owner->data();
    return owned_array<T>(data, std::move(shape), std::move(owner));
}

std::vector<py::ssize_t> shape_of(const Extent& extent) { return {extent.z, extent.y, extent.x}; }

py::object number_or_none(double value) {
    if (std::isnan(value)) return py::none();
    return py::float_(value);
}

void add_statistics(py::dict& to, const CloudStatistics& s) {
    to["hum"] = s.hum;
    to["act"] = s.act;
    to["cld"] = s.cld;
    to["cloud_cover"] = s.cover;
    to["base_m"] = number_or_none(s.base_m);
    to["top_m"] = number_or_none(s.top_m);
    to["base_mean_m"] = number_or_none(s.base_mean_m);
    to["top_mean_m"] = number_or_none(s.top_mean_m);
    to["perimeter_m"] = number_or_none(s.perimeter_m);
    to["mean_density"] = number_or_none(s.mean_density);
    to["optical_cover"] = number_or_none(s.optical_cover);
}

// A basic string of TOML.
std::string quoted(const std::string& text) {
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') result += '\\';
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
            result += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
        } else {
            result += c;
        }
    }
    return result + '"';
}

}  // namespace

py::array cells_array(const LayerPlanes& layer, Plane plane) {
    const BitPlaneView bits = ((*layer.planes).*plane).view();
    const Extent e = bits.extent;
    auto cells = std::make_shared<std::vector<std::uint8_t>>();
    {
        const ReleasedLock released;
        cells->resize(e.cells());
        std::uint8_t* to = cells->data();
        for (int k = 0; k < e.z; ++k) {
            for (int j = 0; j < e.y; ++j) {
                const std::uint64_t* row = bits.row(j, k);
                for (int i = 0; i < e.x; ++i) *to++ = std::uint8_t((row[i / 64] >> (i % 64)) & 1U);
            }
        }
    }
    static_assert(sizeof(bool) == 1);
    const auto* data = reinterpret_cast<const bool*>(cells->data());
    return owned_array<bool>(data, shape_of(e), std::move(cells));
}

py::array words_array(const LayerPlanes& layer, Plane plane) {
    const BitPlaneView bits = ((*layer.planes).*plane).view();
    return owned_array<std::uint64_t>(
        bits.words, {bits.extent.z, bits.extent.y, py::ssize_t(bits.words_per_row)}, layer.planes);
}

py::array voxels_array(const DensityGrid& grid) {
    std::vector<float> voxels;
    {
        const ReleasedLock released;
        voxels = grid.to_dense();
    }
    return vector_array(std::move(voxels), shape_of(grid.extent()));
}

py::array pixels_array(Rgb8Image image) {
    return vector_array(std::move(image.rgb), {image.height, image.width, 3});
}

py::dict statistics_dict(const StepResult& result, const std::optional<std::size_t>& layer) {
    py::dict row;
    row["step"] = result.step;
    row["time_s"] = result.time_s;
    if (!layer) {
        add_statistics(row, result.statistics);
        row["hash"] = result.hash.hex();
        return row;
    }
    if (result.layers.empty())
        throw Error(ErrorCode::usage, "the scene has no layers, and no statistics of one");
    const LayerStep& of = result.layers[*layer];
    row["state"] = of.state;
    row["clouds"] = of.clouds;
    row["rain_areas"] = of.rain_areas;
    row["rain_mm_per_h"] = of.rain_mm_per_h;
    add_statistics(row, of.statistics);
    row["hash"] = of.hash.hex();
    return row;
}

py::dict clouds_dict(const std::vector<ConnectedCloud>& clouds, const Placement& placement, bool in_space) {
    const double cell = placement.cell_size_m;
    const Vec3& origin = placement.origin_m;
    py::dict table;
    const auto add = [&]<typename Value>(const char* name, Value value) {
        std::vector<decltype(value(clouds.front()))> column(clouds.size());
        std::ranges::transform(clouds, column.begin(), value);
        table[name] = vector_array(std::move(column), {py::ssize_t(clouds.size())});
    };
    add("cells", [](const ConnectedCloud& c) { return c.cells; });
    if (in_space) {
        add("volume_m3", [&](const ConnectedCloud& c) { return double(c.cells) * cell * cell * cell; });
        add("surface_m2", [&](const ConnectedCloud& c) { return double(c.edges) * cell * cell; });
    } else {
        add("area_m2", [&](const ConnectedCloud& c) { return double(c.cells) * cell * cell; });
        add("perimeter_m", [&](const ConnectedCloud& c) { return double(c.edges) * cell; });
    }
    add("x_m", [&](const ConnectedCloud& c) { return origin.x + c.x * cell; });
    add("y_m", [&](const ConnectedCloud& c) { return origin.y + c.y * cell; });
    if (in_space) {
        add("z_m", [&](const ConnectedCloud& c) { return origin.z + c.z * cell; });
        add("base_m", [&](const ConnectedCloud& c) { return origin.z + c.lowest * cell; });
        add("top_m", [&](const ConnectedCloud& c) { return origin.z + (c.highest + 1) * cell; });
    }
    // std::vector<bool> has no array of bool.
    const auto add_flag = [&](const char* name, bool ConnectedCloud::*flag) {
        auto values = std::make_shared<std::vector<std::uint8_t>>();
        for (const ConnectedCloud& cloud : clouds) values->push_back(std::uint8_t(cloud.*flag));
        const auto* data = reinterpret_cast<const bool*>(values->data());
        table[name] = owned_array<bool>(data, {py::ssize_t(clouds.size())}, std::move(values));
    };
    add_flag("cut", &ConnectedCloud::cut);
    add_flag("spans", &ConnectedCloud::spans);
    return table;
}

namespace {

constexpr int kDeepest = 64;  // lists and dicts in each other

// Returns a text of Python as UTF-8. Throws Error(usage) on lone surrogates, as names of files have them.
std::string utf8_of(const py::str& text) {
    Py_ssize_t size = 0;
    const char* bytes = PyUnicode_AsUTF8AndSize(text.ptr(), &size);
    if (bytes != nullptr) return {bytes, std::size_t(size)};
    PyErr_Clear();
    throw Error(ErrorCode::usage,
                py::repr(text).cast<std::string>() +
                    ": is no text of Unicode, which the text of a scene or a plan has to be");
}

std::string toml_text(const py::handle& value, int depth) {
    if (depth > kDeepest)
        throw Error(ErrorCode::usage, "a value holds lists or dicts nested more than 64 deep, or itself");
    if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
    if (py::isinstance<py::int_>(value)) return py::str(value).cast<std::string>();
    if (py::isinstance<py::float_>(value)) {
        const double number = value.cast<double>();
        std::string text = number_text(number);
        const bool whole = std::isfinite(number) && text.find_first_of(".e") == std::string::npos;
        return whole ? text + ".0" : text;
    }
    if (py::isinstance<py::str>(value)) return quoted(utf8_of(py::reinterpret_borrow<py::str>(value)));
    if (py::isinstance<py::dict>(value)) {
        std::string text;
        for (const auto& [key, entry] : py::reinterpret_borrow<py::dict>(value)) {
            text += (text.empty() ? "" : ", ") + quoted(utf8_of(py::str(key))) + " = " +
                    toml_text(entry, depth + 1);
        }
        return "{" + text + "}";
    }
    // Arrays and numbers of NumPy.
    if (py::hasattr(value, "tolist")) {
        const py::object plain = value.attr("tolist")();
        // A long double has no other form than itself.
        if (!py::type::of(plain).is(py::type::of(value))) return toml_text(plain, depth + 1);
    }
    if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
        std::string text;
        for (const py::handle& entry : value)
            text += (text.empty() ? "" : ", ") + toml_text(entry, depth + 1);
        return "[" + text + "]";
    }
    throw Error(
        ErrorCode::usage,
        fmt::format("a value of type {} cannot stand in a scene; expected a bool, number, text, list or dict",
                    py::str(py::type::of(value).attr("__name__")).cast<std::string>()));
}

}  // namespace

std::string toml_text(const py::handle& value) { return toml_text(value, 0); }

}  // namespace nephos
