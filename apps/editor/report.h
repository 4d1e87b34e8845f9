// SPDX-License-Identifier: Apache-2.0
#pragma once

// Times and rates of a session, for --report.

#include <chrono>
#include <cstdint>
#include <vector>

namespace nephos {

struct Editor;

struct Report {
    using Clock = std::chrono::steady_clock;

    // Measures the time from a change of the scene, or a step that was gone to, to its picture.
    struct Wait {
        std::uint64_t wanted = 0;
        Clock::time_point since;
        bool waits = false;
        int count = 0;
        double longest_s = 0;
        void begin(std::uint64_t what);
        void end();
    };

    Clock::time_point begin = Clock::now();
    double first_frame_s = 0, first_picture_s = 0, first_picture_processor_s = 0, longest_frame_s = 0;
    std::uint64_t frames = 0;
    std::vector<double> intervals;  // between frames that were drawn without waiting for input
    Wait change, seek;
    const void* scene = nullptr;  // that they are of

    // Once a frame, when the newest picture was taken.
    void watch(const Editor& editor);
    void print(const Editor& editor) const;
};

double seconds_since(Report::Clock::time_point begin);

}  // namespace nephos
