// SPDX-License-Identifier: Apache-2.0
#pragma once

// Lines in the world over the picture, and handles that the mouse takes: along an axis, round a turn, freely. A handle
// gives the value that it was taken with plus all of its way since, so that rounding what is written down loses nothing.
// One mouse: one handle is held at a time.

#include <functional>
#include <optional>
#include <string>

#include <imgui.h>

#include "core/vec.h"

namespace nephos {

struct Editor;

void world_line(const Editor& editor, const Vec3& from, const Vec3& to, ImU32 colour, float width = 1.2f);
void box_lines(const Editor& editor, const Vec3& min, const Vec3& max, ImU32 colour);
// A closed line through points of 0..1.
void loop_lines(const Editor& editor, const std::function<Vec3(double)>& point, ImU32 colour, int parts = 40);
void ellipsoid_lines(const Editor& editor, const Vec3& centre, const Vec3& axes, double yaw_deg, ImU32 colour);
// Turns about the vertical, counter-clockwise from above.
Vec3 turned(const Vec3& v, double yaw_deg);

// To be called before handles are drawn, and also where none are: the mouse has let go of one that went out of sight, or of an
// element that is not selected any more.
void let_go_of_handles(const Editor& editor);

// Returns whether the mouse holds a handle.
bool holds_handle();

// A handle at from + size_m * axis, which moves along that axis (unit length). While the mouse holds it: `value` as it was
// when it was taken, plus the metres since.
std::optional<double> axis_handle(Editor& editor, const std::string& name, const Vec3& from, const Vec3& axis,
                                  double size_m, ImU32 colour, double value);

// A handle at point(value_deg), which moves along that curve. While the mouse holds it: the degrees where it is.
std::optional<double> angle_handle(Editor& editor, const std::string& name, const std::function<Vec3(double)>& point,
                                   ImU32 colour, double value_deg);

// A handle that moves in the plane of the picture. While the mouse holds it: where it is.
std::optional<Vec3> free_handle(Editor& editor, const std::string& name, const Vec3& place, ImU32 colour);

// Returns a number with no more digits than a pixel of the picture means at what is looked at.
double tidy_m(const Editor& editor, double metres);

}  // namespace nephos
