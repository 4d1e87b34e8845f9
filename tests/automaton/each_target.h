// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "automaton/kernels.h"

namespace nephos::test {

// Calls check() with each instruction set that the kernels are compiled for and this processor has, the
// baseline among them.
template <class Check>
void with_each_target(const Check& check) {
    const std::int64_t targets = HWY_TARGETS & (hwy::SupportedTargets() | HWY_STATIC_TARGET);
    for (std::int64_t rest = targets; rest != 0; rest &= rest - 1) {
        const std::int64_t target = rest & -rest;
        SCOPED_TRACE(hwy::TargetName(target));
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(target);
        EXPECT_STREQ(kernel_target(), hwy::TargetName(target));
        check();
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
}

}  // namespace nephos::test
