// SPDX-License-Identifier: Apache-2.0
// Sidecars of an export against its list.

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "core/error.h"
#include "simulation/checked_json.h"
#include "simulation/export/export_list.h"
#include "simulation/export/sequence.h"

namespace nephos {
namespace {

void require_text(const CheckedJson& json, const std::string& expected) {
    if (json.text() != expected) json.fail("\"" + expected + "\"");
}

const NamedFormat& format_of(const CheckedJson& json) {
    const std::string name = json.text();
    const auto& formats = export_formats();
    const auto found = std::ranges::find(formats, name, &NamedFormat::name);
    if (found == formats.end()) json.fail("a format of `nephos export`");
    return *found;
}

// Throws Error(io) that names the first value which is not what the list says.
void check_sidecar(const std::filesystem::path& path, const ListedExport& list,
                   const ListedExport::Sequence& s, const std::set<std::string>& listed) {
    const nlohmann::ordered_json parsed = parsed_json(path);
    const CheckedJson json(parsed, path);
    require_text(json.at("format"), "nephos volume");
    json.at("format_version").integer(1, 1);
    require_text(json.at("name"), s.name);
    if (float(json.at("scale").real(1e-30, 1e30)) != s.scale)
        json.at("scale").fail(fmt::format("{}, as in export.json", s.scale));
    std::vector<std::string> extensions;
    for (const CheckedJson& one : json.at("formats").items()) {
        const NamedFormat& format = format_of(one.at("format"));
        const auto type = list.types.find(std::string(format.name));
        if (type == list.types.end()) one.at("format").fail("a format of export.json");
        if (is_dense(format.format)) require_text(one.at("type"), std::string(type_name(type->second)));
        require_text(one.at("files"), s.name + "_%04d" + std::string(format.extension));
        extensions.emplace_back(format.extension);
    }
    const std::vector<CheckedJson> frames = json.at("frames").items();
    if (json.at("count").integer(0, INT32_MAX) != std::int64_t(frames.size()))
        json.at("count").fail(fmt::format("{}, the number of `frames`", frames.size()));
    for (const CheckedJson& frame : frames) {
        const std::int64_t number = frame.at("number").integer(1, INT32_MAX);
        for (const std::string& extension : extensions) {
            const std::string file = fmt::format("{}_{:04}{}", s.name, number, extension);
            if (!listed.contains(file))
                frame.at("number").fail("the number of a listed file: there is no " + file);
        }
        frame.at("time_s").real(-1e15, 1e15);
    }
}

}  // namespace

std::optional<Check> check_sidecars(const std::filesystem::path& folder, const ListedExport& list) {
    std::set<std::string> listed;
    for (const ExportedFile& file : list.files) listed.insert(file.path.generic_string());
    std::size_t count = 0, bad = 0;
    std::string problem;
    for (const ListedExport::Sequence& s : list.sequences) {
        const std::string name = s.name + ".volume.json";
        if (!listed.contains(name)) continue;  // of layers alone, or interrupted
        ++count;
        try {
            check_sidecar(folder / name, list, s, listed);
        } catch (const Error& error) {
            if (bad++ == 0) problem = error.what();
        }
    }
    if (count == 0) return {};
    if (bad > 1) problem += fmt::format("; and {} more", bad - 1);
    return Check{"sidecars", bad == 0,
                 bad == 0 ? "names, types, scale and frames are those of the list" : problem};
}

}  // namespace nephos
