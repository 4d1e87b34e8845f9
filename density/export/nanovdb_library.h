// SPDX-License-Identifier: Apache-2.0
#pragma once

// The headers of NanoVDB, for .cpp files alone (not installed): they take seconds, and warn.

#define NANOVDB_USE_OPENVDB
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wcast-qual"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <nanovdb/util/GridChecksum.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#pragma GCC diagnostic pop
