// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/ground.h"
// Wet, snowy or farmed ground, or water, behind view_finish.comp.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/background.glsl"
#include "render/vulkan/ground.glsl"
