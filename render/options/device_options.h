// SPDX-License-Identifier: Apache-2.0
#pragma once

// Which back-end and which device draw a picture.

#include <string>

namespace nephos {

// The back-end that draws. Without detail pictures agree within 1/255; clouds with detail are ray-marched by cpu and
// vulkan, and smooth metaballs in blended.
enum class Splatting {
    automatic,  // vulkan where there is a Vulkan device that is not of type CPU, or one is requested; else cpu
    cpu,        // vectors on the processor, tile by tile, front to back; requires no Vulkan driver
    vulkan,     // compute shaders, tile by tile, front to back
    blended,    // billboards with attenuation textures, blended back to front, as D has it: the reference
};

struct DeviceOptions {
    // Part of a device's name ("llvmpipe") or its number in device_names(). Empty: the environment variable
    // NEPHOS_DEVICE in the same form; without it a discrete card, then an integrated, a virtual and a
    // software one. An error with Splatting::cpu.
    std::string device;
    // Load the Khronos validation layer with synchronization validation and collect what it says. Slow; for
    // tests. No effect where the back-end cpu draws.
    bool validation = false;
    // Longest side of the part of a picture that is in device memory at once, 16..16384 pixels. No effect on
    // the picture; memory on the device is about 24 bytes * part_size^2, and with Splatting::vulkan 40 bytes more to
    // read back two pictures. Less where the device allows no such buffers or images.
    int part_size = 2048;
    Splatting splatting = Splatting::automatic;
};

// Returns the device that is requested by name or number, by the options or by NEPHOS_DEVICE; empty: any. Reads the
// environment.
std::string requested_device(const DeviceOptions& options);

// Returns true when drawing with these options fails without a Vulkan driver: a Vulkan back-end or, for the automatic
// choice, a device is requested.
bool needs_vulkan(const DeviceOptions& options);

}  // namespace nephos
