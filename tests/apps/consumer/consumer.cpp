// SPDX-License-Identifier: Apache-2.0

// Steps an automaton and writes its density: what a program of somebody else looks like.

#include <cstdio>

#include "automaton/automaton.h"
#include "core/error.h"
#include "density/smoothing.h"
#include "density/vdb/vdb_file.h"

int main(int argc, char** argv) try {
    if (argc != 2) return 2;
    nephos::AutomatonOptions options;
    options.extent = {64, 64, 32};
    options.seed = 7;
    options.field.background = {0.1, 0.001, 0.02};

    nephos::Automaton automaton(options);
    for (int n = 0; n < 20; ++n) automaton.step();

    const nephos::TimedPlane now{automaton.cld(), 0};
    const nephos::DensityGrid density =
        nephos::smooth({&now, 1}, nephos::SmoothingOptions{}, options.placement, options.boundaries);
    nephos::VdbContent content;
    content.density = &density;
    content.cells = options.placement;
    nephos::write_vdb(argv[1], content,
                      nephos::VdbMetadata{.time_s = automaton.time_s(), .seed = options.seed});
    std::printf("%s %llu\n", automaton.hash().hex().c_str(),
                static_cast<unsigned long long>(density.active_voxels()));
    return density.active_voxels() > 0 ? 0 : 1;
} catch (const nephos::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return int(error.code());
}
