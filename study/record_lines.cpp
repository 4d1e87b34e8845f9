// SPDX-License-Identifier: Apache-2.0
#include "study/record_lines.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "automaton/checkpoint.h"
#include "core/error.h"
#include "core/random.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kHashField = ",\"xxh3\":\"";

// Closes an object with the hash of all before.
std::string sealed(const Json& json) {
    std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    text.pop_back();
    const std::string hash = hash_text(text);
    return text + std::string(kHashField) + hash + "\"}\n";
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }
double number_of(const Json& json) { return json.is_number() ? json.get<double>() : std::nan(""); }

Json head(const PlannedRun& run, std::string_view status) {
    return {{"run", run.id},
            {"status", status},
            {"statistics_version", NEPHOS_STATISTICS_VERSION},
            {"random_stream_version", kRandomStreamVersion},
            {"replicate", run.replicate},
            {"seed", std::to_string(run.seed)},
            {"values", run.values}};
}

Regime regime_of(const std::string& name) {
    for (int n = 0; n <= int(Regime::not_steady); ++n)
        if (regime_name(Regime(n)) == name) return Regime(n);
    throw Error(ErrorCode::io, "'" + name + "' is not a regime");
}

// Returns the text where it is base64, so that a page may contain it as it is; nothing otherwise.
std::string base64_only(std::string text) {
    const bool good = std::ranges::all_of(text, [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' ||
               c == '/' || c == '=';
    });
    return good ? text : std::string();
}

}  // namespace

std::string hash_text(std::string_view text) { return hash_of_bytes(std::as_bytes(std::span(text))).hex(); }

bool is_whole_record(std::string_view line) {
    const std::size_t at = line.rfind(kHashField);
    if (at == line.npos || !line.ends_with("\"}")) return false;
    const std::size_t begin = at + kHashField.size();
    return line.substr(begin, line.size() - 2 - begin) == hash_text(line.substr(0, at));
}

bool ends_as_record(std::string_view line) {
    constexpr std::size_t kDigits = 32;
    constexpr std::string_view kEnd = "\"}";
    if (line.size() < kHashField.size() + kDigits + kEnd.size() || !line.ends_with(kEnd)) return false;
    line.remove_suffix(kEnd.size());
    const std::string_view hash = line.substr(line.size() - kDigits);
    return hash.find_first_not_of("0123456789abcdef") == hash.npos &&
           line.substr(0, line.size() - kDigits).ends_with(kHashField);
}

RunRecord record_of(const Json& json) {
    RunRecord record;
    record.id = json.at("run").get<std::string>();
    record.failed = json.at("status") != "done";
    if (record.failed) {
        record.message = json.at("message").get<std::string>();
        return record;
    }
    RunResult& result = record.result;
    result.regime = regime_of(json.at("regime").get<std::string>());
    result.steps = json.at("steps").get<std::uint64_t>();
    result.warm_up = json.at("warm_up_steps").get<std::uint64_t>();
    result.used = json.at("used_steps").get<std::uint64_t>();
    result.period = json.at("period_steps").get<std::uint64_t>();
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const Json& s = json.at("statistics").at(std::string(kStatistics[n].name));
        result.statistics[n] = {number_of(s.at(0)), number_of(s.at(1)), number_of(s.at(2)),
                                number_of(s.at(3)), number_of(s.at(4))};
    }
    result.profile = json.at("profile").get<std::vector<double>>();
    result.sizes = json.at("sizes").get<std::vector<std::uint64_t>>();
    result.snapshots = json.at("snapshots").get<std::uint64_t>();
    if (const auto tracks = json.find("tracks"); tracks != json.end())
        for (std::size_t n = 0; n < kTrackColumns.size(); ++n)
            result.tracks.push_back(number_of(tracks->at(n)));
    result.state_hash = json.at("state_hash").get<std::string>();
    record.series_offset = json.at("series_offset").get<std::uint64_t>();
    record.series_bytes = json.at("series_bytes").get<std::uint64_t>();
    // Records of earlier versions have none.
    if (const auto hash = json.find("series_xxh3"); hash != json.end())
        record.series_xxh3 = hash->get<std::string>();
    if (const auto thumbnail = json.find("thumbnail"); thumbnail != json.end())
        result.thumbnail = base64_only(thumbnail->get<std::string>());
    return record;
}

std::string record_line(const PlannedRun& run, const RunResult& result, std::uint64_t series_offset,
                        std::string_view series) {
    Json json = head(run, "done");
    json["regime"] = regime_name(result.regime);
    json["steps"] = result.steps;
    json["warm_up_steps"] = result.warm_up;
    json["used_steps"] = result.used;
    json["period_steps"] = result.period;
    Json statistics = Json::object();
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const SeriesMean& s = result.statistics[n];
        statistics[std::string(kStatistics[n].name)] = {number(s.mean), number(s.error), number(s.deviation),
                                                        number(s.tau), number(s.effective)};
    }
    json["statistics"] = std::move(statistics);
    json["profile"] = result.profile;
    json["sizes"] = result.sizes;
    json["snapshots"] = result.snapshots;
    if (!result.tracks.empty()) {
        Json tracks = Json::array();
        for (const double value : result.tracks) tracks.push_back(number(value));
        json["tracks"] = std::move(tracks);
    }
    json["state_hash"] = result.state_hash;
    json["series_offset"] = series_offset;
    json["series_bytes"] = series.size();
    json["series_xxh3"] = hash_text(series);
    if (!result.thumbnail.empty()) json["thumbnail"] = result.thumbnail;
    return sealed(json);
}

std::string failure_line(const PlannedRun& run, std::string_view message) {
    Json json = head(run, "failed");
    json["message"] = message;
    return sealed(json);
}

}  // namespace nephos
