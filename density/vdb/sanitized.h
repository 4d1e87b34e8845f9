// SPDX-License-Identifier: Apache-2.0
#pragma once

// NEPHOS_SANITIZED: a sanitizer watches the program. Its shadow memory needs terabytes of addresses, and its checks and reports
// system calls and files, so that no process can be confined. GCC defines macros for those with shadow memory, Clang has features;
// for the others the preset says it (CMakePresets.json).

#ifndef NEPHOS_SANITIZED
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NEPHOS_SANITIZED 1
#elif defined(__has_feature)
#define NEPHOS_SANITIZED (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer))
#else
#define NEPHOS_SANITIZED 0
#endif
#endif
