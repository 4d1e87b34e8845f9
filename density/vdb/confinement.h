// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a process that parses files of strangers may still do (not installed).

#include <cstddef>
#include <span>

#include <sys/types.h>

namespace nephos {

// Confines the calling process, a child that has one thread, for the rest of its life. What remains: its memory, up to
// `memory_bytes` more than it has now, and threads; reading from and writing to `kept` descriptors; processor time of some
// `seconds`. All other descriptors are closed, output to the terminal goes nowhere, and there is no core dump; it gains no
// rights by executing files and ends with its `parent`. Empty memory replaces what it shares with others. A seccomp
// filter refuses (EPERM) every other system call: to open, examine, rename or remove files, to make sockets and processes,
// to execute, to signal other processes. Programs that a sanitizer instruments are neither filtered nor limited in memory.
// Throws std::runtime_error where a step fails, such as on a system without seccomp.
void confine(pid_t parent, std::span<const int> kept, std::size_t memory_bytes, double seconds);

}  // namespace nephos
