// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <chrono>

#include "core/error.h"
#include "scenes/metar/taf.h"

namespace nephos {
namespace {

constexpr double kHour = 3600;
constexpr double kRapid_s = 1200;  // of a change that FM gives a minute for

bool all_digits(std::string_view text) {
    return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}
int number(std::string_view text) {
    int value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

std::vector<std::string> words_of(std::string_view text) {
    std::vector<std::string> words;
    for (std::size_t at = text.find_first_not_of(" \t\r\n"); at != text.npos;) {
        const std::size_t end = std::min(text.find_first_of(" \t\r\n", at), text.size());
        std::string word(text.substr(at, end - at));
        if (word.ends_with('=')) word.pop_back();
        if (!word.empty()) words.push_back(std::move(word));
        at = text.find_first_not_of(" \t\r\n", end);
    }
    return words;
}

std::string joined(const std::vector<std::string>& words, std::size_t first, std::size_t end) {
    std::string text;
    for (std::size_t n = first; n < end; ++n) text += (text.empty() ? "" : " ") + words[n];
    return text;
}

// "2112/2218"
bool is_interval(const std::string& word) {
    return word.size() == 9 && word[4] == '/' && all_digits(word.substr(0, 4)) && all_digits(word.substr(5));
}
bool is_from(const std::string& word) {
    return word.size() == 8 && word.starts_with("FM") && all_digits(word.substr(2));
}
bool begins_change(const std::string& word) {
    return word == "BECMG" || word == "TEMPO" || word == "INTER" || word.starts_with("PROB") || is_from(word);
}

// Returns the number of days of the month in "2024-06" or longer; 0 when it is empty. Throws Error(usage) when it is no
// month.
int days_of_month(std::string_view date) {
    using namespace std::chrono;
    if (date.empty()) return 0;
    const bool has_form =
        date.size() >= 7 && date[4] == '-' && all_digits(date.substr(0, 4)) && all_digits(date.substr(5, 2));
    const year_month_day_last last =
        has_form
            ? year(number(date.substr(0, 4))) / month(unsigned(number(date.substr(5, 2)))) / std::chrono::last
            : year_month_day_last(year(0), month_day_last(month(0)));
    if (!last.ok())
        throw Error(ErrorCode::usage,
                    "--date '" + std::string(date) + "' is no month: expected one such as 2024-06");
    return int(unsigned(last.day()));
}

class TafReader {
  public:
    TafReader(std::string_view text, bool lenient, std::string_view date)
        : words_(words_of(text)), lenient_(lenient), days_of_month_(days_of_month(date)) {
        taf_.text = joined(words_, 0, words_.size());
    }

    Taf read() {
        read_head();
        std::size_t end = next_change();
        taf_.periods.push_back({"", 0, 0, weather_of("the forecast's beginning", end)});
        at_ = end;
        while (at_ < words_.size()) read_change();
        return std::move(taf_);
    }

  private:
    [[noreturn]] void fail(const std::string& expected) const {
        const std::string word = at_ < words_.size() ? "`" + words_[at_] + "`" : "the forecast ends early";
        std::string text = joined(words_, 0, std::min(at_, words_.size()));
        const std::size_t column = text.size() + (text.empty() ? 0 : 1);
        const std::size_t length = at_ < words_.size() ? words_[at_].size() : 1;
        throw Error(ErrorCode::usage, word + ": " + expected + "\n  " + taf_.text + "\n  " +
                                          std::string(column, ' ') + std::string(length, '^'));
    }

    std::size_t next_change() const {
        std::size_t n = at_;
        while (n < words_.size() && !begins_change(words_[n]) && words_[n] != "RMK") ++n;
        return n;
    }

    // The word stands behind the time of validity, or in its place.
    void refuse_cancelled() const {
        if (at_ < words_.size() && words_[at_] == "CNL") fail("the forecast was cancelled");
    }

    void read_head() {
        while (at_ < words_.size() && (words_[at_] == "TAF" || words_[at_] == "AMD" || words_[at_] == "COR"))
            ++at_;
        if (at_ >= words_.size() || words_[at_].size() != 4)
            fail("expected the four capital letters of an aerodrome, such as EGLL");
        taf_.station = words_[at_++];
        // The moment of issue may be missing.
        if (at_ < words_.size() && words_[at_].size() == 7 && words_[at_].back() == 'Z') ++at_;
        if (at_ < words_.size() && words_[at_] == "NIL") fail("the forecast says that there is none");
        refuse_cancelled();
        if (at_ >= words_.size() || !is_interval(words_[at_]))
            fail(
                "expected the time of validity, such as 2112/2218: from the 21st, 12 UTC, to the 22nd, 18 "
                "UTC");
        const std::string& valid = words_[at_];
        taf_.day = number(valid.substr(0, 2));
        taf_.hour = number(valid.substr(2, 2));
        // The last day of the month that the forecast names.
        for (const std::string& word : words_) {
            if (is_interval(word))
                last_day_ = std::max({last_day_, number(word.substr(0, 2)), number(word.substr(5, 2))});
            if (is_from(word)) last_day_ = std::max(last_day_, number(word.substr(2, 2)));
        }
        const bool goes_on = number(valid.substr(5, 2)) < taf_.day;
        if (days_of_month_ > 0)
            last_day_ = std::max(days_of_month_, taf_.day);
        else if (goes_on && last_day_ < 31)
            taf_.notes.push_back("the month is taken to end on day " + std::to_string(last_day_) +
                                 ", the last that the forecast names: --date says which month it is");
        taf_.length_s = moment(valid.substr(5), 0);
        if (!is_moment(valid.substr(0, 4)) || taf_.hour > 23 || !is_moment(valid.substr(5)) || taf_.length_s <= 0 ||
            taf_.length_s > 48 * kHour)
            fail("expected a validity of at most 48 hours, from day 01 to 31, hour 00 to 23, to hour 00 to 24");
        ++at_;
        refuse_cancelled();
    }

    // Returns whether it is a day of the month and an hour, "2118".
    bool is_moment(const std::string& text) const {
        const int day = number(text.substr(0, 2)), hour = number(text.substr(2, 2));
        return day >= 1 && day <= last_of_month() && hour <= 24;
    }
    int last_of_month() const { return days_of_month_ > 0 ? days_of_month_ : 31; }

    // Seconds after the beginning of validity of a day and an hour, "2118".
    double moment(const std::string& text, int minute) const {
        const int day = number(text.substr(0, 2)), hour = number(text.substr(2, 2));
        const int days = day >= taf_.day ? day - taf_.day : last_day_ - taf_.day + day;
        return (24.0 * days + hour - taf_.hour) * kHour + 60.0 * minute;
    }

    // The groups from here to `end` as a report; those that only forecasts have are noted.
    Metar weather_of(const std::string& where, std::size_t end) {
        std::string report = taf_.station + " 010000Z";
        no_weather_ = false;
        for (std::size_t n = at_; n < end; ++n) {
            const std::string& word = words_[n];
            const bool temperature =
                (word.starts_with("TX") || word.starts_with("TN")) && word.find('/') != word.npos;
            if (word == "NSW") {
                no_weather_ = true;
            } else if (temperature || word.starts_with("WS") || word.starts_with("QNH")) {
                taf_.notes.push_back("`" + word + "` is not in the scene");
            } else {
                report += " " + word;
            }
        }
        try {
            Metar metar = parse_metar(report, lenient_);
            for (const std::string& warning : metar.warnings) taf_.notes.push_back(where + ": " + warning);
            return metar;
        } catch (const Error& error) {
            throw Error(error.code(), "in " + where + ": " + error.what());
        }
    }

    void read_change() {
        const std::string word = words_[at_];
        if (word == "RMK") {
            taf_.notes.push_back("`" + joined(words_, at_, words_.size()) +
                                 "` (remarks) is not in the scene");
            at_ = words_.size();
            return;
        }
        const std::size_t first = at_++;
        if (word != "BECMG" && !is_from(word)) {
            // PROB30 TEMPO 2118/2121 ...: what may be for a while.
            while (at_ < words_.size() && (words_[at_] == "TEMPO" || words_[at_] == "INTER")) ++at_;
            const std::size_t end = next_change();
            taf_.notes.push_back("`" + joined(words_, first, end) +
                                 "` is not in the scene: it lasts a while, or is not certain");
            at_ = end;
            return;
        }
        TafPeriod period;
        TafPeriod& before = taf_.periods.back();
        if (is_from(word)) {
            const int minute = number(word.substr(6, 2));
            at_ = first;
            if (!is_moment(word.substr(2, 4)) || minute > 59)
                fail("expected day, hour and minute of the change, such as FM211530");
            ++at_;
            const double moment_s = moment(word.substr(2, 4), minute);
            if (before.change.starts_with("BECMG") && moment_s > before.from_s && moment_s < before.until_s) {
                taf_.notes.push_back("`" + before.change + "` ends where `" + word + "` begins");
                before.until_s = moment_s;
            }
            // It may begin where the change before it has just ended.
            period.from_s = moment_s < before.until_s ? moment_s : std::max(moment_s - kRapid_s / 2, before.until_s);
            period.until_s = moment_s + kRapid_s / 2;
        } else {
            if (at_ >= words_.size() || !is_interval(words_[at_]))
                fail("expected the time of the change, such as 2115/2118");
            const std::string begin = words_[at_].substr(0, 4), end = words_[at_].substr(5);
            if (!is_moment(begin) || !is_moment(end))
                fail("expected days from 01 to " + std::to_string(last_of_month()) +
                     " and hours from 00 to 24");
            period.from_s = moment(begin, 0);
            period.until_s = moment(end, 0);
            ++at_;
            if (period.until_s > period.from_s && read_overlap(first, period)) return;
        }
        period.change = joined(words_, first, at_);
        if (period.until_s <= period.from_s || period.from_s < before.until_s ||
            period.from_s > taf_.length_s) {
            at_ = first;
            fail("expected changes in the order of time, within the validity");
        }
        const std::size_t end = next_change();
        const Metar change = weather_of(period.change, end);
        period.weather = is_from(word) ? change : changed(before.weather, change);
        at_ = end;
        taf_.periods.push_back(std::move(period));
    }

    // Changes of parts of the weather may overlap: one within the time of that before it joins it, and one that lasts
    // longer begins at its end.
    bool read_overlap(std::size_t first, TafPeriod& period) {
        TafPeriod& before = taf_.periods.back();
        if (taf_.periods.size() == 1 || period.from_s < before.from_s || period.from_s >= before.until_s) return false;
        const std::string text = joined(words_, first, at_);
        if (period.until_s > before.until_s) {
            taf_.notes.push_back("`" + text + "` begins at the end of `" + before.change + "`, which it overlaps");
            period.from_s = before.until_s;
            return false;
        }
        const std::size_t end = next_change();
        before.weather = changed(before.weather, weather_of(text, end));
        before.change += ", " + text;
        at_ = end;
        return true;
    }

    // The weather after a change that names part of it.
    Metar changed(Metar weather, const Metar& change) const {
        const bool clear = change.cavok || std::ranges::any_of(change.groups, [](const MetarGroup& group) {
                               return group.text == "NSC" || group.text == "SKC" || group.text == "CLR";
                           });
        if (change.wind.known) weather.wind = change.wind;
        if (change.visibility_m) weather.visibility_m = change.visibility_m;
        if (!change.weather.empty() || no_weather_ || change.cavok) weather.weather = change.weather;
        if (!change.clouds.empty() || clear) weather.clouds = change.clouds;
        weather.cavok = change.cavok;
        return weather;
    }

    Taf taf_;
    std::vector<std::string> words_;
    bool lenient_ = false, no_weather_ = false;
    std::size_t at_ = 0;
    int last_day_ = 0, days_of_month_ = 0;  // the latter 0: not known
};

}  // namespace

bool is_taf(std::string_view text) {
    const std::vector<std::string> words = words_of(text);
    return !words.empty() && words.front() == "TAF";
}

Taf parse_taf(std::string_view text, bool lenient, std::string_view date) {
    return TafReader(text, lenient, date).read();
}

}  // namespace nephos
