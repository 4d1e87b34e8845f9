// SPDX-License-Identifier: Apache-2.0

// The compiled part of the Python package `nephos`: classes and their docstrings. Types stand in nephos/__init__.pyi.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "statistics/cloud_statistics.h"
#include "statistics/organisation.h"
#include <fmt/format.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include "apps/python/arrays.h"
#include "apps/python/live_simulation.h"
#include "apps/python/released_lock.h"
#include "apps/python/scene_text.h"
#include "core/error.h"
#include "scenes/format/override.h"
#include "scenes/format/text.h"

namespace py = pybind11;
using namespace py::literals;

namespace nephos {
namespace {

// Between two looks at whether Ctrl-C was pressed.
constexpr double kSignalInterval_s = 0.05;

std::string code_name(ErrorCode code) {
    switch (code) {
        case ErrorCode::check:
            return "check";
        case ErrorCode::usage:
            return "usage";
        case ErrorCode::io:
            return "io";
        case ErrorCode::gpu:
            return "gpu";
    }
    return "usage";
}

py::object text_of(const std::string& text) {
    return py::reinterpret_steal<py::object>(
        PyUnicode_DecodeUTF8(text.data(), py::ssize_t(text.size()), "backslashreplace"));
}

// nephos::Error becomes nephos.Error.
void add_error(py::module_& module) {
    static py::exception<Error> type(module, "Error");
    type.attr("__module__") = "nephos";
    type.attr("__doc__") =
        "A bad argument or scene, a file that cannot be read, a device that fails: the text is that of the "
        "command.\n\n"
        "code: 'usage', 'io', 'gpu' or 'check'. file, line, column: the place in a text, None where there is "
        "none.";
    py::register_exception_translator([](std::exception_ptr pointer) {
        try {
            if (pointer) std::rethrow_exception(pointer);
        } catch (const Error& error) {
            const py::handle make = type;
            const py::object object = make(text_of(error.what()));
            const SourcePosition& where = error.where();
            object.attr("code") = code_name(error.code());
            object.attr("file") = where.file.empty() ? py::object(py::none()) : text_of(where.file);
            object.attr("line") = where.line > 0 ? py::object(py::int_(where.line)) : py::object(py::none());
            object.attr("column") =
                where.column > 0 ? py::object(py::int_(where.column)) : py::object(py::none());
            PyErr_SetObject(type.ptr(), object.ptr());
        }
    });
}

void add_scene(py::module_& module) {
    py::class_<SceneText>(
        module, "Scene",
        "A scene, which never changes: set() returns another one. Every key, its unit, range and "
        "default stand in docs/scene-reference.md.")
        .def(py::init([](const std::filesystem::path& path) {
                 const ReleasedLock released;
                 return SceneText::from_file(path);
             }),
             "path"_a,
             "Reads a scene file. Raises Error with every mistake of it, each with file, line and column.")
        .def_static(
            "from_text",
            [](const std::string& text, const std::filesystem::path& folder) {
                const ReleasedLock released;
                return SceneText::from_text(text, folder);
            },
            "text"_a, "folder"_a = std::filesystem::path(),
            "Takes a scene as TOML text. Relative file names in it are relative to `folder`.")
        .def(
            "set",
            [](const SceneText& scene, const std::string& key, const py::object& value) {
                // A key with a "=" of its own would set something else.
                if (const std::string problem = key_problem(key); !problem.empty())
                    throw Error(ErrorCode::usage, "'" + shortened(key) + "': " + problem);
                const std::string setting = key + "=" + toml_text(value);
                const ReleasedLock released;
                return scene.with(setting);
            },
            "key"_a, "value"_a,
            "Returns a copy with one key set, as --set of the command does: set('field.background.ext', "
            "0.12),\n"
            "set('lattice.cells', [64, 64, 16]). `value`: bool, int, float, str, or a list, dict or NumPy "
            "array of "
            "these.\nRaises Error where there is no such key or the value is out of range.")
        .def(
            "_given", [](const SceneText& scene) { return text_of(scene.given()); },
            "Returns the given keys alone, as a scene file in any folder.")
        .def(
            "text", [](const SceneText& scene) { return text_of(scene.canonical()); },
            "Returns the whole scene as TOML, every key with its value, defaults included. Equal scenes have "
            "equal "
            "text.")
        .def_property_readonly("name", [](const SceneText& scene) { return text_of(scene.scene().name); })
        .def_property_readonly("seed", [](const SceneText& scene) { return scene.scene().automaton.seed; })
        .def_property_readonly(
            "steps", [](const SceneText& scene) { return scene.scene().steps; },
            "time.steps; step() is not bound to it.")
        .def(
            "__eq__", [](const SceneText& a, const SceneText& b) { return a.scene() == b.scene(); },
            py::is_operator())
        .def("__repr__", [](const SceneText& scene) {
            return text_of(fmt::format("<nephos.Scene '{}'>", scene.scene().name));
        });
}

void add_density(py::module_& module) {
    py::class_<DensityGrid>(module, "Density",
                            "Cloud density of the present moment, 0..1, on a regular grid.")
        .def_property_readonly(
            "values", &voxels_array,
            "float32 array (nz, ny, nx), z up, y north, x east; read-only, made anew on each access.")
        .def_property_readonly(
            "origin_m",
            [](const DensityGrid& grid) {
                const Vec3& origin = grid.placement().origin_m;
                return py::make_tuple(origin.x, origin.y, origin.z);
            },
            "(x, y, z) of the lower corner of voxel [0, 0, 0], metres; z is the height above ground. The "
            "centre of\n"
            "values[k, j, i] lies at origin_m + (i + 0.5, j + 0.5, k + 0.5) * cell_size_m.")
        .def_property_readonly(
            "cell_size_m", [](const DensityGrid& grid) { return grid.placement().cell_size_m; },
            "Edge of a voxel, metres.")
        .def("__repr__", [](const DensityGrid& grid) {
            const Extent e = grid.extent();
            return fmt::format("<nephos.Density of {} x {} x {} voxels of {} m>", e.x, e.y, e.z,
                               grid.placement().cell_size_m);
        });
}

// A whole number of Python, as int, NumPy's or any that has __index__; messages name the argument.
std::uint64_t whole_number(const py::object& value, std::string_view name, std::string_view expected) {
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
    const unsigned long long taken = number ? PyLong_AsUnsignedLongLong(number.ptr()) : 0;
    if (PyErr_Occurred() == nullptr) return taken;
    const bool is_wrong = PyErr_ExceptionMatches(PyExc_TypeError) ||
                          PyErr_ExceptionMatches(PyExc_OverflowError) ||
                          PyErr_ExceptionMatches(PyExc_ValueError);
    if (!is_wrong) throw py::error_already_set();  // Ctrl-C and the like
    PyErr_Clear();
    throw Error(ErrorCode::usage,
                fmt::format("{} is {}; expected {}", name, py::repr(value).cast<std::string>(), expected));
}

// Takes the steps with the interpreter lock released, and looks for signals in between.
LiveSimulation& take_steps(LiveSimulation& simulation, const py::object& n) {
    std::uint64_t count = whole_number(n, "n", "a whole number of steps, 0 or more");
    while (count > 0) {
        {
            const ReleasedLock released;
            count -= simulation.step(count, kSignalInterval_s);
        }
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    return simulation;
}

py::dict statistics_of(LiveSimulation& simulation, const std::optional<LayerKey>& layer, bool density) {
    std::optional<std::size_t> number;
    if (layer) number = simulation.layer_number(*layer);
    StepResult result;
    {
        const ReleasedLock released;
        result = simulation.statistics(density);
    }
    return statistics_dict(result, number);
}

py::dict clouds_of(LiveSimulation& simulation, const LayerKey& layer, int dimensions, int neighbours) {
    if (dimensions != 2 && dimensions != 3)
        throw Error(ErrorCode::usage, fmt::format("dimensions is {}; expected 2 or 3", dimensions));
    const bool corners = dimensions == 2 && neighbours == 8;
    if (!corners && neighbours != (dimensions == 2 ? 4 : 6) && neighbours != 0) {
        throw Error(ErrorCode::usage, fmt::format("neighbours is {}; expected {}", neighbours,
                                                  dimensions == 2 ? "4 or 8" : "6 in 3 dimensions"));
    }
    LayerPlanes planes;
    std::vector<ConnectedCloud> clouds;
    {
        const ReleasedLock released;
        planes = simulation.planes(layer);
        const BitPlaneView cld = planes.planes->cld.view();
        clouds = dimensions == 3
                     ? clouds_3d(cld, planes.boundaries)
                     : clouds_2d(cld, planes.boundaries, corners ? Neighbours::eight : Neighbours::four);
    }
    return clouds_dict(clouds, planes.placement, dimensions == 3);
}

py::dict organisation_of(LiveSimulation& simulation, const LayerKey& layer, int draws) {
    if (draws < 2 || draws > 10'000)
        throw Error(ErrorCode::usage, fmt::format("draws is {}; expected 2 to 10000", draws));
    Organisation found;
    NullOrganisation random;
    {
        const ReleasedLock released;
        const LayerPlanes planes = simulation.planes(layer);
        const BitPlaneView cld = planes.planes->cld.view();
        const double cover =
            double(count_cells(shadow_of(cld).view())) / (double(cld.extent.x) * cld.extent.y);
        found = organisation(clouds_2d(cld, planes.boundaries), cld.extent, planes.boundaries);
        random = null_organisation(cld.extent, planes.boundaries, cover, draws, 1);
    }
    py::dict row;
    const auto add = [&row, &found, &random](const std::string& name, double Organisation::*index) {
        row[name.c_str()] = found.*index;
        row[(name + "_random").c_str()] = random.mean.*index;
        row[(name + "_random_sd").c_str()] = random.deviation.*index;
    };
    add("iorg", &Organisation::iorg);
    add("scai", &Organisation::scai);
    add("cop", &Organisation::cop);
    return row;
}

Plane plane_named(const std::string& name) {
    if (name == "hum") return &Lattice::hum;
    if (name == "act") return &Lattice::act;
    if (name == "cld") return &Lattice::cld;
    throw Error(ErrorCode::usage, fmt::format("no plane '{}'; expected hum, act or cld", name));
}

LayerPlanes planes_of(LiveSimulation& simulation, const LayerKey& layer) {
    const ReleasedLock released;
    return simulation.planes(layer);
}

template <Plane plane>
py::array cells_of(LiveSimulation& simulation, const LayerKey& layer) {
    return cells_array(planes_of(simulation, layer), plane);
}

#define NEPHOS_CELLS                                                                                        \
    ", bool array (nz, ny, nx): z up, y north, x east. Read-only, a copy that later steps do not change.\n" \
    "`layer`: number or name, of a scene with layers. Raises Error for a layer without automaton."

void add_simulation(py::module_& module) {
    py::class_<LiveSimulation>(
        module, "Simulation",
        "A scene that is stepped. Equal scenes and seeds give equal bits, whatever the number of threads. "
        "Long calls\n"
        "release the interpreter lock; calls of several threads on one simulation take turns.")
        .def(py::init([](const SceneText& scene, const py::object& seed) {
                 Scene changed = scene.scene();
                 if (!seed.is_none())
                     changed.automaton.seed = whole_number(seed, "seed", "a whole number from 0 to 2^64 - 1");
                 const ReleasedLock released;
                 return std::make_unique<LiveSimulation>(std::move(changed));
             }),
             "scene"_a, "seed"_a = py::none(),
             "Starts at step 0. `seed`, 0 to 2^64 - 1, replaces the scene's. Raises Error where it does not "
             "fit into "
             "memory.")
        .def("step", &take_steps, "n"_a = 1, py::return_value_policy::reference_internal,
             "Takes n steps, and returns the simulation. Ctrl-C ends it between two steps. Raises Error "
             "where n "
             "is no\n"
             "whole number of 0 or more.")
        .def_property_readonly("step_number", &LiveSimulation::step_number, py::call_guard<ReleasedLock>(),
                               "Steps taken.")
        .def_property_readonly("time_s", &LiveSimulation::time_s, py::call_guard<ReleasedLock>(),
                               "Simulated time, seconds.")
        .def_property_readonly("layers", &LiveSimulation::layers,
                               "Names of the layers; [''] of a scene without layers.")
        .def("hash", &LiveSimulation::hash, py::call_guard<ReleasedLock>(),
             "Returns the hash of the state, 32 hexadecimal digits: that of `nephos hash` and of "
             "statistics.csv.")
        .def("hum", &cells_of<&Lattice::hum>, "layer"_a = 0, "Vapour enough to form cloud" NEPHOS_CELLS)
        .def("act", &cells_of<&Lattice::act>, "layer"_a = 0, "Phase transition about to happen" NEPHOS_CELLS)
        .def("cld", &cells_of<&Lattice::cld>, "layer"_a = 0, "Cloud" NEPHOS_CELLS)
        .def(
            "words",
            [](LiveSimulation& simulation, const std::string& plane, const LayerKey& layer) {
                const Plane of = plane_named(plane);
                return words_array(planes_of(simulation, layer), of);
            },
            "plane"_a, "layer"_a = 0,
            "Returns the plane 'hum', 'act' or 'cld' as it is stored, a read-only view without a copy: "
            "uint64 array\n"
            "(nz, ny, words), cell [k, j, i] is bit i % 64 of word [k, j, i // 64], unused bits are 0. Later "
            "steps do "
            "not\nchange it.")
        .def("statistics", &statistics_of, "layer"_a = py::none(), "density"_a = false,
             "Returns the statistics of the present state, by the names of the columns of statistics.csv, or "
             "of\n"
             "statistics/LAYER.csv with `layer`; units stand in the names. None: no value. `mean_density` is "
             "None unless\n"
             "`density`, which smooths the bits first and takes far longer.")
        .def("clouds", &clouds_of, "layer"_a = 0, "dimensions"_a = 2, "neighbours"_a = 0,
             "Returns single clouds as read-only arrays, one value a cloud, by name, ready for "
             "pandas.DataFrame.\n"
             "dimensions 2, seen from above, columns joined by sides (neighbours 4) or also corners (8): "
             "cells (columns),\n"
             "area_m2, perimeter_m, x_m, y_m (centroid), cut (touches an open side), spans (reaches across "
             "the box).\n"
             "dimensions 3, cells joined by faces: cells, volume_m3, surface_m2, x_m, y_m, z_m, base_m, "
             "top_m, cut, spans.\n"
             "Clouds are joined across periodic sides.")
        .def("organisation", &organisation_of, "layer"_a = 0, "draws"_a = 20,
             "Returns how clouds stand, seen from above: iorg (0.5 at random for points, above clustered), "
             "scai "
             "(low is\n"
             "organised), cop (high is organised), nan with fewer than two clouds; beside each its mean and "
             "standard deviation\n"
             "over `draws` shadows of the same cover without organisation, iorg_random and iorg_random_sd "
             "...: "
             "compare with\n"
             "these, as clouds have a size. Definitions and sources: docs/research.md. Takes n^2 operations "
             "for "
             "n clouds.")
        .def("density", &LiveSimulation::density, "layer"_a = py::none(), py::call_guard<ReleasedLock>(),
             "Returns the Density of a layer, or of all together: cld smoothed in space and time, where the "
             "bits are. "
             "Density\n"
             "files without density.refine have the same, carried with the wind by a part of a cell to where "
             "the air is\n"
             "(docs/adr/0020-carried-frames.md). Raises Error where clouds are drawn without one.")
        .def(
            "picture",
            [](LiveSimulation& simulation) {
                Rgb8Image image;
                {
                    const ReleasedLock released;
                    image = simulation.picture();
                }
                return pixels_array(std::move(image));
            },
            "Returns a picture as camera, sun and the other keys of the scene have it: uint8 array (height, "
            "width, 3), row 0\n"
            "at the top, sRGB; read-only. camera.width and camera.height are its size, frames.splatting says "
            "what draws.")
        .def("__repr__", [](const LiveSimulation& simulation) {
            const ReleasedLock released;
            return fmt::format("<nephos.Simulation at step {}>", simulation.step_number());
        });
}

// Python's own way, by protocols 0 and 1, leaves what the object holds out, and ends the process that reads it back.
void refuse_pickling(const py::object& type) {
    type.attr("__reduce__") = py::cpp_function(
        [](const py::object& self) -> py::object {
            const auto name = py::type::of(self).attr("__name__").cast<std::string>();
            throw py::type_error("cannot pickle '" + name +
                                 "': send the scene's text(), and its steps and seed, instead");
        },
        py::name("__reduce__"), py::is_method(type));
}

void set_threads(int count) {
    static std::unique_ptr<tbb::global_control> limit;
    if (count < 0)
        throw Error(ErrorCode::usage, fmt::format("{} threads; expected 0 (all cores) or more", count));
    limit.reset();
    if (count > 0) {
        limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                      std::size_t(count));
    }
}

}  // namespace
}  // namespace nephos

// A process that was forked off has none of its parent's threads, and log4cplus, which OpenVDB brings along, waits for its own
// when the process ends: by then all that Python has to do is done, and what the system does follows.
void end_forked_process_at_once(int status, void* parent) {
    if (::getpid() == pid_t(reinterpret_cast<std::intptr_t>(parent))) return;
    std::fflush(nullptr);
    ::_exit(status);
}

namespace {

void fill(pybind11::module_& module) {
    ::on_exit(&end_forked_process_at_once, reinterpret_cast<void*>(std::intptr_t(::getpid())));
    nephos::add_error(module);
    nephos::add_scene(module);
    nephos::add_density(module);
    nephos::add_simulation(module);
    for (const char* name : {"Scene", "Density", "Simulation"}) nephos::refuse_pickling(module.attr(name));
    module.def(
        "set_threads", &nephos::set_threads, "count"_a,
        "Limits the threads of all simulations of this process; 0: all cores. Results do not depend on it.");
    module.def("_toml_text", &nephos::toml_text, "value"_a,
               "Returns a value as it stands in a scene or a plan.");
    module.def("version", &nephos::version, "Returns the version of nephos.");
}

pybind11::module_::module_def definition;

}  // namespace

// As PYBIND11_MODULE, which would wait for ever in an interpreter within another: pybind11 asks there for a lock that is held.
extern "C" PYBIND11_EXPORT PyObject* PyInit__nephos() {
    if (PyInterpreterState_Get() != PyInterpreterState_Main()) {
        PyErr_SetString(
            PyExc_ImportError,
            "nephos cannot be imported in a subinterpreter: expected the main interpreter of the process");
        return nullptr;
    }
    PYBIND11_CHECK_PYTHON_VERSION
    PYBIND11_ENSURE_INTERNALS_READY
    auto module = pybind11::module_::create_extension_module("_nephos", nullptr, &definition);
    try {
        fill(module);
        return module.ptr();
    }
    PYBIND11_CATCH_INIT_EXCEPTIONS
}
