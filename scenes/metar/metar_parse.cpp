// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "scenes/metar/report_words.h"

namespace nephos {
namespace {

constexpr double kStatuteMile_m = 1609.344;
constexpr std::size_t kMostClouds = 8;  // groups of clouds: reports have three, some countries six

bool all_slashes(std::string_view text) { return !text.empty() && text.find_first_not_of('/') == text.npos; }
bool is_count(std::string_view text) { return all_digits(text) && text.size() <= 3; }

// The report word by word, up to `end`. Each of the read_ functions takes the group at hand if it is of its kind.
class Reader {
  public:
    Reader(const ReportWords& report, std::size_t first, std::size_t end, bool forecast, bool lenient)
        : report_(report),
          words_(report.words),
          at_(first),
          end_(end),
          forecast_(forecast),
          lenient_(lenient) {
        metar_.text = report.text;
    }

    Metar read() {
        if (words_.empty())
            throw Error(
                ErrorCode::usage,
                "the report is empty: expected one such as EGLL 211350Z 24012KT 9999 FEW020 14/08 Q1017");
        while (is("METAR") || is("SPECI") || is("COR")) take("kind of report", false);
        if (done() || !is_aerodrome(word()))
            fail("expected the four capital letters of an aerodrome, such as EGLL");
        metar_.station = word();
        take("aerodrome");
        read_time();
        return read_groups();
    }

    Metar read_groups() {
        while (!done()) {
            if (is("NIL")) fail("the report says that there is none (NIL)");
            if (!forecast_ && is("RMK")) return take_rest("remarks");
            if (!forecast_ && (is("NOSIG") || is("BECMG") || is("TEMPO"))) return take_rest("trend");
            read_group();
        }
        return finished();
    }

  private:
    bool done() const { return at_ >= end_; }
    const std::string& word() const { return words_[at_].text; }
    bool is(std::string_view text) const { return !done() && word() == text; }

    void take(std::string meaning, bool used = true, std::size_t words = 1) {
        std::string text = word();
        const std::size_t column = words_[at_].column;
        for (std::size_t n = 1; n < words; ++n) text += " " + words_[at_ + n].text;
        metar_.groups.push_back({std::move(text), column, std::move(meaning), used});
        at_ += words;
    }

    [[noreturn]] void fail(const std::string& expected) const { fail_at(report_, at_, expected); }

    Metar take_rest(const char* meaning) {
        take(meaning, false, end_ - at_);
        return finished();
    }

    Metar finished() {
        if (metar_.cavok && (!metar_.clouds.empty() || !metar_.weather.empty())) {
            const auto excluded = std::ranges::find_if(metar_.groups, [](const MetarGroup& group) {
                return (group.meaning.starts_with("cloud") && group.meaning != "clouds unknown") ||
                       group.meaning.starts_with("weather") || group.meaning.starts_with("sky obscured");
            });
            const auto at = std::ranges::find(words_, excluded != metar_.groups.end() ? excluded->column : 0,
                                              &ReportWord::column);
            fail_at(report_, std::size_t(at - words_.begin()),
                    "CAVOK excludes clouds and weather, but the report has them");
        }
        return std::move(metar_);
    }

    void read_time() {
        if (done()) fail("expected day and time, such as 211350Z");
        const std::string& w = word();
        const bool good = w.size() == 7 && all_digits(std::string_view(w).substr(0, 6)) && w[6] == 'Z';
        const int day = good ? number(w.substr(0, 2)) : 0, hour = good ? number(w.substr(2, 2)) : 0,
                  minute = good ? number(w.substr(4, 2)) : 0;
        if (!good || day < 1 || day > 31 || hour > 23 || minute > 59)
            fail("expected day and time (UTC), such as 211350Z");
        metar_.day = day;
        metar_.hour = hour;
        metar_.minute = minute;
        take("day and time, UTC");
    }

    void read_group() {
        if (is("AUTO") || is("COR")) {
            metar_.automatic = metar_.automatic || is("AUTO");
            return take(is("AUTO") ? "automatic station" : "corrected", false);
        }
        if (forecast_ && read_of_forecast()) return;
        if (read_wind() || read_visibility() || read_sky() || read_temperature() || read_pressure() ||
            read_other() || read_weather())
            return;
        if (is_interval(word()))
            fail(forecast_ ? "expected BECMG, TEMPO, INTER or PROB in front of the time of a change"
                           : "expected groups of a report: the text of a forecast begins with TAF");
        if (!lenient_) fail("expected wind, visibility, weather, clouds, temperature or pressure");
        metar_.warnings.push_back("`" + word() + "` is no group that is known, and was left out");
        take("not understood", false);
    }

    // Groups that only forecasts have.
    bool read_of_forecast() {
        const std::string& w = word();
        if (w == "NSW") {
            take("no significant weather");
            return true;
        }
        const bool temperature = (w.starts_with("TX") || w.starts_with("TN")) && w.find('/') != w.npos;
        const bool shear = w.starts_with("WS") && w.size() > 2;
        if (!temperature && !shear && !w.starts_with("QNH")) return false;
        take(temperature ? "temperature" : shear ? "wind shear" : "pressure", false);
        return true;
    }

    // dddff[Gff]UNIT; parts may be slashes, the unit may be missing or a word of its own.
    bool read_wind() {
        std::string w = word();
        std::size_t words = 1;
        if (w.size() == 7 && all_digits(w.substr(0, 3)) && w[3] == 'V' && all_digits(w.substr(4)))
            return read_sector(w);
        const auto gap = [&](std::size_t n) { return at_ + n < end_ ? words_[at_ + n].text : std::string(); };
        const bool head = w.size() == 5 && (all_digits(w) || w.starts_with("VRB"));
        if (head && gap(1).size() >= 5 && gap(1).front() == 'G' &&
            (gap(1).ends_with("KT") || gap(1).ends_with("MPS"))) {
            w += gap(1);
            words = 2;
        }
        double unit = kKnot;
        bool with_unit = true;
        std::string value = w;
        if (w.ends_with("KT"))
            value.resize(w.size() - 2);
        else if (w.ends_with("MPS"))
            unit = 1, value.resize(w.size() - 3);
        else if (w.ends_with("KMH"))
            unit = 1 / 3.6, value.resize(w.size() - 3);
        else
            with_unit = false;
        if (value.size() < 5) return false;
        const std::string direction = value.substr(0, 3);
        std::string speed = value.substr(3), gust;
        if (const std::size_t g = speed.find('G'); g != speed.npos) {
            gust = speed.substr(g + 1);
            speed.resize(g);
        }
        // P99KT: 100 kt or more.
        bool beyond = false;
        for (std::string* amount : {&speed, &gust}) {
            if (amount->size() != 3 || amount->front() != 'P' || !all_digits(amount->substr(1))) continue;
            amount->erase(0, 1);
            beyond = true;
        }
        const bool known_direction = all_digits(direction), slashes = all_slashes(direction);
        if (!(known_direction || slashes || direction == "VRB")) return false;
        if (!(all_digits(speed) || all_slashes(speed)) || speed.size() > 3 || speed.size() < 2) return false;
        if (!gust.empty() && !is_count(gust) && !all_slashes(gust)) return false;
        if (!with_unit && (gust.empty() || !known_direction)) return false;  // five digits alone are no wind
        if (known_direction && number(direction) > 360 && lenient_) return false;
        if (known_direction && number(direction) > 360) fail("a direction of more than 360 degrees");
        if (seen_wind_) fail("the report has a wind already");
        seen_wind_ = true;
        MetarWind& wind = metar_.wind;
        wind.known = all_digits(speed);
        wind.variable = !known_direction;
        wind.from_deg = known_direction ? number(direction) % 360 : 0;
        wind.speed_m_per_s = wind.known ? number(speed) * unit : 0;
        if (all_digits(gust)) wind.gust_m_per_s = number(gust) * unit;
        take(!wind.known ? "wind unknown"
             : wind.speed_m_per_s == 0
                 ? "calm"
                 : "wind at 10 m" + std::string(beyond ? ", as told or stronger" : "") +
                       std::string(wind.gust_m_per_s ? ", gusts are not simulated" : ""),
             wind.known, words);
        return true;
    }

    // dddVddd: the sector that the wind turns in.
    bool read_sector(const std::string& w) {
        const int from = number(w.substr(0, 3)), to = number(w.substr(4));
        if (std::max(from, to) > 360 && lenient_) return false;
        if (std::max(from, to) > 360) fail("a direction of more than 360 degrees");
        metar_.wind.from_between_deg = from;
        metar_.wind.to_between_deg = to;
        take("wind between " + w.substr(0, 3) + " and " + w.substr(4) + " degrees", false);
        return true;
    }

    bool set_visibility(int metres, const std::string& meaning, std::size_t words = 1) {
        const bool first = !metar_.visibility_m;
        if (first) metar_.visibility_m = metres;
        take(first ? meaning : "a second visibility", first, words);
        return true;
    }

    bool read_visibility() {
        const std::string& w = word();
        if (w == "CAVOK") {
            metar_.cavok = true;
            return set_visibility(9999, "visibility 10 km or more, no cloud below 5,000 ft, no weather");
        }
        if (w.size() >= 4 && all_digits(w.substr(0, 4))) {
            const std::string rest = w.substr(4);
            if (rest.empty() || rest == "NDV")
                return set_visibility(number(w.substr(0, 4)), number(w.substr(0, 4)) == 9999
                                                                  ? "visibility 10 km or more"
                                                                  : "visibility");
            for (const char* direction : {"N", "NE", "E", "SE", "S", "SW", "W", "NW"}) {
                if (rest != direction) continue;
                take("least visibility in one direction", false);
                return true;
            }
        }
        if (w == "////") {
            take("visibility unknown", false);
            return true;
        }
        if (w.size() > 2 && w.front() == 'R' && all_digits(w.substr(1, 2)) && w.find('/') != w.npos) {
            take("runway visual range", false);
            return true;
        }
        // Statute miles: 10SM, 1/2SM, 1 1/2SM, M1/4SM.
        std::string miles = w;
        double whole = 0;
        std::size_t words = 1;
        if (all_digits(w) && w.size() <= 2 && at_ + 1 < end_ && words_[at_ + 1].text.ends_with("SM")) {
            whole = number(w);
            miles = words_[at_ + 1].text;
            words = 2;
        }
        if (!miles.ends_with("SM")) return false;
        miles.resize(miles.size() - 2);
        if (!miles.empty() && (miles.front() == 'M' || miles.front() == 'P')) miles.erase(0, 1);
        const std::size_t slash = miles.find('/');
        double value = 0;
        if (slash == miles.npos) {
            if (!is_count(miles)) return false;
            value = number(miles);
        } else {
            const std::string over = miles.substr(0, slash), under = miles.substr(slash + 1);
            if (!is_count(over) || !is_count(under) || number(under) == 0) return false;
            value = double(number(over)) / number(under);
        }
        return set_visibility(std::min(9999, int(std::lround((whole + value) * kStatuteMile_m))),
                              "visibility", words);
    }

    bool read_sky() {
        const std::string& w = word();
        for (const auto& [text, meaning] : {std::pair{"NSC", "no significant cloud"},
                                            {"NCD", "no cloud detected"},
                                            {"CLR", "no cloud seen by the instrument"},
                                            {"SKC", "sky clear"}}) {
            if (w != text) continue;
            take(meaning);
            return true;
        }
        constexpr std::pair<std::string_view, CloudAmount> kAmounts[] = {{"FEW", CloudAmount::few},
                                                                         {"SCT", CloudAmount::scattered},
                                                                         {"BKN", CloudAmount::broken},
                                                                         {"OVC", CloudAmount::overcast},
                                                                         {"///", CloudAmount::unknown}};
        if (w.size() == 5 && w.starts_with("VV") && (all_digits(w.substr(2)) || all_slashes(w.substr(2)))) {
            check_clouds();
            MetarCloud cloud{CloudAmount::obscured, {}, {}};
            if (all_digits(w.substr(2))) cloud.height_ft = 100 * number(w.substr(2));
            metar_.clouds.push_back(cloud);
            take(cloud.height_ft
                     ? "sky obscured, vertical visibility " + std::to_string(*cloud.height_ft) + " ft"
                     : "sky obscured");
            return true;
        }
        for (const auto& [text, amount] : kAmounts) {
            if (!w.starts_with(text) || w.size() < 6) continue;
            const std::string height = w.substr(3, 3);
            std::string type = w.substr(6);
            // "FEW025CB///": slashes behind a type say nothing; "FEW025 CB" has a gap.
            while (!type.empty() && type.back() == '/') type.pop_back();
            std::size_t words = 1;
            if (type.empty() && w.size() == 6 && at_ + 1 < end_ &&
                (words_[at_ + 1].text == "CB" || words_[at_ + 1].text == "TCU")) {
                type = words_[at_ + 1].text;
                words = 2;
            }
            const bool readable = (all_digits(height) || all_slashes(height)) &&
                                  (type.empty() || type == "CB" || type == "TCU");
            if (!readable && lenient_) return false;
            if (!readable)
                fail("expected an amount, hundreds of feet and perhaps CB or TCU, such as BKN025CB");
            MetarCloud cloud{amount, {}, type};
            if (all_digits(height)) cloud.height_ft = 100 * number(height);
            const bool known = amount != CloudAmount::unknown && cloud.height_ft;
            if (!known && !(cloud.height_ft || !type.empty())) {
                take("clouds unknown", false, words);
                return true;
            }
            check_clouds();
            metar_.clouds.push_back(cloud);
            take(known ? "cloud base at " + std::to_string(*cloud.height_ft) + " ft" +
                             (type.empty() ? "" : ", " + type)
                       : "cloud of unknown amount or height",
                 known, words);
            return true;
        }
        return false;
    }

    void check_clouds() const {
        if (metar_.clouds.size() >= kMostClouds)
            fail("the report has " + std::to_string(kMostClouds) +
                 " groups of clouds already, the most that are read");
    }

    // 14/08, M02/M05, 14///, 14/, /////.
    bool read_temperature() {
        const std::string& w = word();
        const std::size_t slash = w.find('/');
        if (slash == w.npos || w.size() > 7) return false;
        // Whether a part is a temperature, perhaps an unknown one, which leaves `degrees` empty.
        const auto part = [](std::string_view text, std::optional<int>& degrees) {
            if (text.empty() || all_slashes(text) || text == "XX") return true;
            const bool minus = text.front() == 'M';
            if (minus) text.remove_prefix(1);
            if (text.size() != 2 || !all_digits(text)) return false;
            degrees = minus ? -number(text) : number(text);
            return true;
        };
        std::optional<int> temperature, dew;
        if (!part(std::string_view(w).substr(0, slash), temperature) ||
            !part(std::string_view(w).substr(slash + 1), dew))
            return false;
        if (!temperature && !dew && w != "/////" && w != "//" && w != "///") return false;
        if (w == "//" || w == "///") {
            take("not observed", false);
            return true;
        }
        if (temperature || dew) {  // of unknown ones there may be more
            if (seen_temperature_) fail("the report has a temperature already");
            seen_temperature_ = true;
            metar_.temperature_c = temperature;
            metar_.dew_point_c = dew;
        }
        take(temperature ? "temperature and dew point" : "temperature unknown",
             temperature.has_value() && !forecast_);
        return true;
    }

    bool read_pressure() {
        const std::string& w = word();
        if (w.size() != 5 || (w[0] != 'Q' && w[0] != 'A')) return false;
        const std::string value = w.substr(1);
        if (all_slashes(value)) {
            take("pressure unknown", false);
            return true;
        }
        if (!all_digits(value)) return false;
        metar_.pressure_hpa = w[0] == 'Q' ? number(value) : number(value) * 33.8639 / 100;
        take("pressure at mean sea level", false);
        return true;
    }

    // Recent weather, wind shear, runway states, colour states: known, and of no effect.
    bool read_other() {
        const std::string& w = word();
        if (w == "WS") {
            std::size_t words = 1;
            while (at_ + words < end_ && words < 4 &&
                   (words_[at_ + words].text == "ALL" || words_[at_ + words].text == "RWY" ||
                    words_[at_ + words].text.starts_with("R")))
                ++words;
            take("wind shear", false, words);
            return true;
        }
        for (const char* colour : {"BLU", "WHT", "GRN", "YLO", "YLO1", "YLO2", "AMB", "RED", "BLACK"}) {
            if (w != colour) continue;
            take("colour state", false);
            return true;
        }
        if (w.starts_with("RE") && w.size() >= 4) {
            take("recent weather", false);
            return true;
        }
        if (w.size() == 8 && (all_digits(w) || (all_digits(w.substr(0, 2)) && w.find("//") != w.npos))) {
            take("state of a runway", false);
            return true;
        }
        if (w == "SNOCLO" || (w.starts_with("W") && w.find("/S") != w.npos)) {
            take(w == "SNOCLO" ? "closed by snow" : "state of the sea", false);
            return true;
        }
        return false;
    }

    bool read_weather() {
        std::string_view w = word();
        MetarWeather weather;
        if (w.front() == '-' || w.front() == '+') {
            weather.intensity = w.front();
            w.remove_prefix(1);
        }
        if (w.starts_with("VC")) {
            weather.vicinity = true;
            w.remove_prefix(2);
        }
        const auto among = [](std::string_view two, const auto& list) {
            return std::find(list.begin(), list.end(), two) != list.end();
        };
        static constexpr std::array<std::string_view, 8> kDescriptors{"SH", "TS", "FZ", "BL",
                                                                      "DR", "MI", "BC", "PR"};
        static constexpr std::array<std::string_view, 22> kPhenomena{
            "RA", "DZ", "SN", "SG", "PL", "GR", "GS", "UP", "IC", "FG", "BR",
            "HZ", "FU", "VA", "DU", "SA", "PO", "SQ", "FC", "SS", "DS", "PY"};
        if (w.size() >= 2 && among(w.substr(0, 2), kDescriptors)) {
            weather.descriptor = w.substr(0, 2);
            w.remove_prefix(2);
        }
        while (w.size() >= 2 && among(w.substr(0, 2), kPhenomena)) {
            weather.phenomena.emplace_back(w.substr(0, 2));
            w.remove_prefix(2);
        }
        if (!w.empty() || (weather.phenomena.empty() && weather.descriptor.empty())) return false;
        metar_.weather.push_back(weather);
        take(weather.vicinity ? "weather in the vicinity" : "weather", !weather.vicinity);
        return true;
    }

    Metar metar_;
    const ReportWords& report_;
    const std::vector<ReportWord>& words_;
    std::size_t at_, end_;
    bool forecast_, lenient_, seen_wind_ = false, seen_temperature_ = false;
};

}  // namespace

Metar parse_metar(std::string_view text, bool lenient) {
    const ReportWords report = words_of(text);
    return Reader(report, 0, report.words.size(), false, lenient).read();
}

Metar parse_groups(const ReportWords& words, std::size_t first, std::size_t end, bool lenient) {
    return Reader(words, first, end, true, lenient).read_groups();
}

bool tells_nothing(const Metar& metar) {
    const auto time = std::ranges::find(metar.groups, "day and time, UTC", &MetarGroup::meaning);
    return time == metar.groups.end() ||
           std::all_of(time + 1, metar.groups.end(), [](const MetarGroup& group) {
               return group.meaning == "automatic station" || group.meaning == "corrected" ||
                      group.meaning == "remarks" || group.meaning == "trend";
           });
}

bool is_precipitation(std::string_view code) {
    constexpr std::string_view kFalling[] = {"DZ", "RA", "SN", "SG", "PL", "GR", "GS", "UP"};
    if (code.starts_with("FZ")) code.remove_prefix(2);
    if (code.empty() || code.size() > 6 || code.size() % 2 != 0) return false;
    for (; !code.empty(); code.remove_prefix(2))
        if (std::ranges::find(kFalling, code.substr(0, 2)) == std::end(kFalling)) return false;
    return true;
}

}  // namespace nephos
