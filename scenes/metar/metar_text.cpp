// SPDX-License-Identifier: Apache-2.0
// Reports as text, as they are sent.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "scenes/metar/report_words.h"

namespace nephos {
std::optional<CloudAmount> amount_of(double cover) {
    const double oktas = 8 * cover;
    if (oktas < 0.5) return {};
    if (oktas < 2.5) return CloudAmount::few;
    if (oktas < 4.5) return CloudAmount::scattered;
    return oktas < 7.5 ? CloudAmount::broken : CloudAmount::overcast;
}

std::string_view amount_text(CloudAmount amount) {
    constexpr std::string_view kTexts[] = {"FEW", "SCT", "BKN", "OVC", "VV", "///"};
    return kTexts[std::size_t(amount)];
}

std::string metar_text(const Metar& m) {
    std::string text = m.station + " " + padded(m.day, 2) + padded(m.hour, 2) + padded(m.minute, 2) + "Z";
    if (m.wind.known) {
        const int knots = int(std::lround(m.wind.speed_m_per_s / kKnot));
        const int from = (m.wind.from_deg + 5) / 10 * 10;
        const std::string direction = knots == 0        ? "000"
                                      : m.wind.variable ? "VRB"
                                                        : padded(from == 0 ? 360 : from, 3);
        text += " " + direction + padded(knots, 2);
        if (m.wind.gust_m_per_s) text += "G" + padded(int(std::lround(*m.wind.gust_m_per_s / kKnot)), 2);
        text += "KT";
    } else {
        text += " /////KT";
    }
    if (m.cavok) return text + " CAVOK";
    text += m.visibility_m ? " " + padded(*m.visibility_m, 4) : " ////";
    for (const MetarWeather& w : m.weather) {
        text += ' ';
        if (w.intensity != 0) text += w.intensity;
        if (w.vicinity) text += "VC";
        text += w.descriptor;
        for (const std::string& phenomenon : w.phenomena) text += phenomenon;
    }
    for (const MetarCloud& c : m.clouds) {
        text += " " + std::string(amount_text(c.amount)) +
                (c.height_ft ? padded(*c.height_ft / 100, 3) : "///") + c.type;
    }
    if (m.clouds.empty()) text += " NSC";
    if (m.temperature_c && m.dew_point_c) {
        const auto degrees = [&](int t) { return (t < 0 ? "M" : "") + padded(std::abs(t), 2); };
        text += " " + degrees(*m.temperature_c) + "/" + degrees(*m.dew_point_c);
    }
    if (m.pressure_hpa) text += " Q" + padded(int(*m.pressure_hpa), 4);
    return text;
}

}  // namespace nephos
