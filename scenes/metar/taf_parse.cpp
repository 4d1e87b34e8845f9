// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "core/error.h"
#include "scenes/metar/report_words.h"
#include "scenes/metar/scene_parts.h"
#include "scenes/metar/taf.h"

namespace nephos {
namespace {

constexpr double kHour = 3600;
constexpr double kRapid_s = 1200;  // of a change that FM gives a minute for

bool is_from(std::string_view word) {
    return word.size() == 8 && word.starts_with("FM") && all_digits(word.substr(2));
}
// Also of words that are meant to begin one, so that a mistake does not become a group of the change before it.
bool begins_change(std::string_view word) {
    const bool from = word.starts_with("FM") && (word.size() == 2 || all_digits(word.substr(2, 1)));
    return from || word.starts_with("BECMG") || word.starts_with("TEMPO") || word.starts_with("INTER") ||
           word.starts_with("PROB");
}
bool begins_remarks(std::string_view word) { return word == "RMK" || word == "AMD"; }

// The month of --date, and its day where it names one.
struct Date {
    std::chrono::year_month month{};
    int day = 0;  // 0: not told
};

// Throws Error(usage) on a text that is no month or day.
std::optional<Date> date_of(std::string_view text) {
    using namespace std::chrono;
    if (text.empty()) return {};
    const bool has_month =
        text.size() >= 7 && text[4] == '-' && all_digits(text.substr(0, 4)) && all_digits(text.substr(5, 2));
    const bool has_day = text.size() == 10 && text[7] == '-' && all_digits(text.substr(8));
    Date date;
    if (has_month) date.month = year(number(text.substr(0, 4))) / month(unsigned(number(text.substr(5, 2))));
    if (has_day) date.day = number(text.substr(8));
    const bool good = has_month && date.month.ok() && (text.size() == 7 || has_day);
    if (!good || (has_day && !(date.month / day(unsigned(date.day))).ok()))
        throw Error(ErrorCode::usage,
                    "--date '" + std::string(text) + "' is no month: expected one such as 2024-06");
    return date;
}

bool names_clouds(const Metar& m) {
    return !m.clouds.empty() || m.cavok || std::ranges::any_of(m.groups, [](const MetarGroup& group) {
        return group.text == "NSC" || group.text == "SKC" || group.text == "CLR" || group.text == "NCD";
    });
}
bool names_no_weather(const Metar& m) {
    return std::ranges::any_of(m.groups, [](const MetarGroup& group) { return group.text == "NSW"; });
}
// Wind, visibility, weather or clouds.
bool names_nothing(const Metar& m) {
    return !m.wind.known && !m.visibility_m && m.weather.empty() && !names_clouds(m) && !names_no_weather(m);
}

// The weather after a change that names part of it.
Metar changed(Metar weather, const Metar& change) {
    if (change.wind.known) weather.wind = change.wind;
    if (change.visibility_m) weather.visibility_m = change.visibility_m;
    if (!change.weather.empty() || names_no_weather(change) || change.cavok) weather.weather = change.weather;
    if (names_clouds(change)) weather.clouds = change.clouds;
    weather.cavok = change.cavok;
    return weather;
}

class TafReader {
  public:
    TafReader(std::string_view text, bool lenient, std::string_view date)
        : report_(words_of(text)),
          words_(report_.words),
          date_text_(date),
          date_(date_of(date)),
          lenient_(lenient) {
        taf_.text = report_.text;
    }

    Taf read() {
        read_head();
        const std::size_t end = next_change();
        Metar weather = weather_of(end);
        if (names_nothing(weather)) fail("expected wind, visibility, weather or clouds of the beginning");
        if (!weather.wind.known) note("the forecast's beginning names no wind: the air is calm");
        taf_.periods.push_back({"", 0, 0, std::move(weather)});
        at_ = end;
        while (at_ < words_.size()) read_change();
        for (TafPeriod& period : taf_.periods) date_weather(period);
        if (const std::size_t layers = std::max<std::size_t>(1, layers_of(taf_).size()) + kinds_of_rain(taf_);
            layers > kMostTafLayers)
            throw Error(ErrorCode::usage,
                        "the forecast has " + std::to_string(layers) +
                            " different groups of clouds and of what falls: expected at most " +
                            std::to_string(kMostTafLayers) + ", as a scene has layers");
        return std::move(taf_);
    }

  private:
    [[noreturn]] void fail(const std::string& expected) const { fail_at(report_, at_, expected); }
    bool done() const { return at_ >= words_.size(); }
    const std::string& word() const { return words_[at_].text; }
    bool is(std::string_view text) const { return !done() && word() == text; }
    void note(const std::string& text) {
        if (std::ranges::find(taf_.notes, text) == taf_.notes.end()) taf_.notes.push_back(text);
    }

    // Gives the weather of a period its aerodrome, and the moment from which on it is wholly there.
    void date_weather(TafPeriod& period) const {
        const int minutes = taf_.hour * 60 + int(std::lround(period.until_s / 60));
        const int day = taf_.day + minutes / (24 * 60);
        period.weather.station = taf_.station;
        period.weather.day = day > last_day_ ? day - last_day_ : day;
        period.weather.hour = minutes / 60 % 24;
        period.weather.minute = minutes % 60;
    }

    // Throws on a second forecast in between.
    std::size_t next_change() const {
        std::size_t n = at_;
        for (; n < words_.size() && !begins_change(words_[n].text) && !begins_remarks(words_[n].text); ++n)
            if (words_[n].text == "TAF")
                fail_at(report_, n, "expected one forecast, but another begins here");
        return n;
    }

    // The word stands behind the time of validity, or in its place.
    void refuse_cancelled() const {
        if (is("CNL")) fail("the forecast was cancelled");
    }

    void read_head() {
        while (is("TAF") || is("AMD") || is("COR")) ++at_;
        if (done() || !is_aerodrome(word()))
            fail("expected the four capital letters of an aerodrome, such as EGLL");
        taf_.station = words_[at_++].text;
        // The moment of issue may be missing.
        int issue_day = 0;
        if (!done() && word().size() == 7 && word().back() == 'Z') {
            const std::string& issue = word();
            if (!all_digits(issue.substr(0, 6)) || number(issue.substr(0, 2)) < 1 ||
                number(issue.substr(0, 2)) > 31 || number(issue.substr(2, 2)) > 23 ||
                number(issue.substr(4, 2)) > 59)
                fail("expected day and time of issue (UTC), such as 211100Z");
            issue_day = number(words_[at_++].text.substr(0, 2));
        }
        if (is("NIL")) fail("the forecast says that there is none");
        refuse_cancelled();
        if (done() || !is_interval(word()))
            fail(
                "expected the time of validity, such as 2112/2218: from the 21st, 12 UTC, to the 22nd, 18 "
                "UTC");
        const std::string valid = word();
        taf_.day = number(valid.substr(0, 2));
        taf_.hour = number(valid.substr(2, 2));
        set_month(issue_day);
        if (!is_moment(valid.substr(0, 4)) || taf_.hour > 23 || !is_moment(valid.substr(5)))
            fail("expected a validity from day 01 to " + last_of_month_text() +
                 ", hour 00 to 23, to hour 00 to 24");
        set_last_day(valid);
        taf_.length_s = moment(valid.substr(5), 0);
        if (taf_.length_s <= 0 || taf_.length_s > 48 * kHour)
            fail("expected a validity of at most 48 hours, and some");
        ++at_;
        refuse_cancelled();
    }

    // Finds the month of the day on which the forecast becomes valid: that of --date, or a neighbour where the day of issue lies
    // beyond the month's end. A forecast is issued some hours before, or while it is valid.
    void set_month(int issue_day) {
        using namespace std::chrono;
        if (!date_) return;
        if (date_->day != 0 && date_->day != issue_day && date_->day != taf_.day)
            throw Error(
                ErrorCode::usage,
                "--date '" + date_text_ + "' does not fit the forecast's day " + std::to_string(taf_.day) +
                    ": expected a month such as 2024-06, or that day of one, of the years 1900 to 2100");
        if (issue_day > int(unsigned((date_->month / last).day())) && date_->day == 0)
            throw Error(ErrorCode::usage, "--date '" + date_text_ + "' has no day " +
                                              std::to_string(issue_day) +
                                              ": expected the month in which the forecast was issued");
        year_month valid = date_->month;
        constexpr int kHalfMonth = 15;
        if (issue_day != 0 && date_->day != taf_.day) {
            if (issue_day - taf_.day > kHalfMonth) valid += months(1);
            if (taf_.day - issue_day > kHalfMonth) valid -= months(1);
        }
        days_of_month_ = int(unsigned((valid / last).day()));
        taf_.date = padded(int(valid.year()), 4) + "-" + padded(int(unsigned(valid.month())), 2) + "-" +
                    padded(taf_.day, 2);
    }

    // Finds the last day of the month in which the forecast becomes valid, or the last that it names.
    void set_last_day(const std::string& valid) {
        const bool goes_on = number(valid.substr(5, 2)) < taf_.day;
        last_day_ = days_of_month_ > 0 ? days_of_month_ : goes_on ? taf_.day : 31;
        if (days_of_month_ > 0 || !goes_on) return;
        for (std::size_t n = at_; n < words_.size() && !begins_remarks(words_[n].text); ++n) {
            const std::string_view w = words_[n].text;
            const auto take = [&](std::string_view day) {
                if (number(day) <= 31) last_day_ = std::max(last_day_, number(day));
            };
            if (is_interval(w)) take(w.substr(0, 2)), take(w.substr(5, 2));
            if (is_from(w)) take(w.substr(2, 2));
        }
        if (last_day_ < 31)
            note("the month is taken to end on day " + std::to_string(last_day_) +
                 ", the last that the forecast names: --date says which month it is");
    }

    // Returns whether it is a day of the month and an hour, "2118".
    bool is_moment(const std::string& text) const {
        const int day = number(text.substr(0, 2)), hour = number(text.substr(2, 2));
        return day >= 1 && day <= last_of_month() && hour <= 24;
    }
    int last_of_month() const { return days_of_month_ > 0 ? days_of_month_ : 31; }
    std::string last_of_month_text() const {
        return std::to_string(last_of_month()) +
               (days_of_month_ > 0 ? ", the last of the month in which it becomes valid" : "");
    }

    // Seconds after the beginning of validity of a day and an hour, "2118".
    double moment(const std::string& text, int minute) const {
        const int day = number(text.substr(0, 2)), hour = number(text.substr(2, 2));
        const int days = day >= taf_.day ? day - taf_.day : last_day_ - taf_.day + day;
        return (24.0 * days + hour - taf_.hour) * kHour + 60.0 * minute;
    }

    // The groups from here to `end`; those that are left out are noted.
    Metar weather_of(std::size_t end) {
        Metar metar = parse_groups(report_, at_, end, lenient_);
        for (const std::string& text : left_out(metar, taf_.periods.empty())) note(text);
        return metar;
    }

    void read_change() {
        if (is("TAF")) fail("expected one forecast, but another begins here");
        if (begins_remarks(word())) {
            note("`" + joined(report_, at_, words_.size()) + "` (remarks) is not in the scene");
            at_ = words_.size();
        } else if (word().starts_with("FM")) {
            read_from();
        } else if (word().starts_with("BECMG")) {
            read_becoming();
        } else {
            leave_out_change();
        }
    }

    // PROB30 TEMPO 2118/2121 ...: what may be for a while. It is read, as a mistake in it may hide a change.
    void leave_out_change() {
        const std::size_t first = at_;
        const auto lasts = [&] { return is("TEMPO") || is("INTER"); };
        const bool likely = word().size() == 6 && word().starts_with("PROB") && all_digits(word().substr(4));
        if (!likely && !lasts()) fail("expected TEMPO, INTER, or PROB with a percentage, such as PROB30");
        ++at_;
        if (likely && lasts()) ++at_;
        read_interval();
        const std::size_t end = next_change();
        const Metar weather = parse_groups(report_, at_, end, lenient_);
        for (const std::string& warning : weather.warnings) note(warning);
        note("`" + joined(report_, first, end) +
             "` is not in the scene: it lasts a while, or is not certain");
        at_ = end;
    }

    // Takes the time of a change, "2115/2118".
    std::pair<double, double> read_interval() {
        if (done() || !is_interval(word())) fail("expected the time of the change, such as 2115/2118");
        const std::string begin = word().substr(0, 4), end = word().substr(5);
        if (!is_moment(begin) || !is_moment(end))
            fail("expected days from 01 to " + last_of_month_text() + ", and hours from 00 to 24");
        const std::pair<double, double> times{moment(begin, 0), moment(end, 0)};
        if (!(times.second > times.first)) fail("expected a change that ends after it has begun");
        ++at_;
        return times;
    }

    // Changes come by the time at which they begin.
    void require_order(std::size_t at, double begin_s) {
        if (begin_s < last_begin_s_ || begin_s >= taf_.length_s)
            fail_at(report_, at, "expected changes in the order of time, within the validity");
        last_begin_s_ = begin_s;
    }

    // FM211530 ...: all of the weather is another one from then on, whatever change was under way.
    void read_from() {
        const std::size_t first = at_;
        const std::string moment_text = word();
        if (!is_from(moment_text) || !is_moment(moment_text.substr(2, 4)) ||
            number(moment_text.substr(6)) > (moment_text.substr(4, 2) == "24" ? 0 : 59))
            fail("expected day, hour and minute of the change, such as FM211530, with days up to " +
                 last_of_month_text());
        const double moment_s = moment(moment_text.substr(2, 4), number(moment_text.substr(6)));
        const bool twice = taf_.periods.back().change.starts_with("FM") && moment_s <= last_begin_s_;
        if (twice) fail("expected changes in the order of time, within the validity");
        require_order(first, moment_s);
        ++at_;
        const std::size_t end = next_change();
        Metar weather = weather_of(end);
        if (names_nothing(weather)) fail("expected wind, visibility, weather or clouds from then on");
        while (taf_.periods.size() > 1 && taf_.periods.back().from_s >= moment_s) {
            note("`" + taf_.periods.back().change + "` is not in the scene: `" + moment_text +
                 "` comes before it");
            taf_.periods.pop_back();
        }
        TafPeriod& before = taf_.periods.back();
        if (before.until_s > moment_s) {
            if (before.change.starts_with("BECMG"))
                note("`" + before.change + "` ends where `" + moment_text + "` begins");
            before.until_s = moment_s;
        }
        if (!weather.wind.known) {
            note("`" + moment_text + "` names no wind: that before it goes on");
            weather.wind = before.weather.wind;
        }
        if (!names_clouds(weather))
            note("`" + moment_text + "` names no clouds: there are none from then on");
        taf_.periods.push_back({moment_text, std::max(moment_s - kRapid_s / 2, before.until_s),
                                moment_s + kRapid_s / 2, std::move(weather)});
        at_ = end;
    }

    // BECMG 2115/2118 ...: part of the weather changes, some time in between. One within the time of that before it joins it, and
    // one that lasts longer begins at its end.
    void read_becoming() {
        const std::size_t first = at_;
        if (!is("BECMG")) fail("expected BECMG and the time of the change, such as BECMG 2115/2118");
        ++at_;
        auto [from_s, until_s] = read_interval();
        require_order(first, from_s);
        const std::string text = joined(report_, first, at_);
        const std::size_t end = next_change();
        const Metar change = weather_of(end);
        if (names_nothing(change)) fail("expected the wind, visibility, weather or clouds that it becomes");
        at_ = end;
        if (until_s > taf_.length_s) note("`" + text + "` goes on after the end of the forecast's validity");
        TafPeriod& before = taf_.periods.back();
        const Metar weather = changed(before.weather, change);
        if (from_s < before.until_s) {
            const bool gradual = before.change.starts_with("BECMG");
            if (until_s <= before.until_s) {
                note("`" + text + "` is a part of `" + before.change + "`, within which it lies");
                before.weather = weather;
                before.change += ", " + text;
                return;
            }
            if (gradual)
                note("`" + text + "` begins at the end of `" + before.change + "`, which it overlaps");
            from_s = before.until_s;
        }
        taf_.periods.push_back({text, from_s, until_s, weather});
    }

    Taf taf_;
    const ReportWords report_;
    const std::vector<ReportWord>& words_;
    std::string date_text_;
    std::optional<Date> date_;
    bool lenient_ = false;
    std::size_t at_ = 0;
    double last_begin_s_ = 0;               // of the change before, as told
    int last_day_ = 0, days_of_month_ = 0;  // the latter 0: not known
};

}  // namespace

bool is_taf(std::string_view text) {
    const std::size_t begin = std::min(text.find_first_not_of(" \t\r\n"), text.size());
    const std::string_view rest = text.substr(begin);
    return rest.starts_with("TAF") &&
           (rest.size() == 3 || std::string_view(" \t\r\n=").find(rest[3]) != rest.npos);
}

Taf parse_taf(std::string_view text, bool lenient, std::string_view date) {
    return TafReader(text, lenient, date).read();
}

}  // namespace nephos
