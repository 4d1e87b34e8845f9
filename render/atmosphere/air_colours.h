// SPDX-License-Identifier: Apache-2.0
#pragma once

// The light of an atmosphere in linear sRGB. With SkyColours::primaries its three wavelengths are taken as
// red, green and blue; with SkyColours::spectral two atmospheres of three wavelengths each are integrated to
// colours (spectrum.h). Private to the module.

#include <cstddef>
#include <vector>

#include "render/atmosphere/atmosphere.h"

namespace nephos {

class AirColours {
  public:
    AirColours(const AtmosphereModel& model, SkyColours colours);

    // Returns the model that it was made of; with spectral colours its coefficients are those of thin air.
    const AtmosphereModel& model() const { return model_; }
    SkyColours colours() const { return colours_; }

    // The functions of Atmosphere, as colours. Transmittances of AirTable are those of the sun's light above the
    // air, for which they are 1 without air.
    Rgb above_air() const;  // of the sun
    Rgb transmittance(double altitude_m, double sine) const;
    Rgb sunlight(double altitude_m, double sun_elevation_deg) const;
    SkyIrradiance irradiance(double altitude_m, double sun_elevation_deg) const;
    SkyTable sky(double eye_altitude_m, double sun_elevation_deg) const;
    AirTable air(double eye_altitude_m, double sun_elevation_deg) const;

  private:
    template <class Light>
    Rgb colour_of(const Light& light) const;

    AtmosphereModel model_;
    SkyColours colours_;
    std::vector<Atmosphere> bands_;  // one, or two whose wavelengths alternate
};

}  // namespace nephos
