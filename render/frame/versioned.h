// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numbers for the states of what back-ends hold copies of: the light of a cloud, its shadow map, the scattering
// table. Whoever holds a copy keeps the number of the state that was copied and compares it with the number of
// the resource; nobody has to tell anybody that something has changed. Private to the module.

#include <atomic>
#include <cstdint>
#include <utility>

namespace nephos {

// No two states of any resources share a number, so that a number alone tells resource and state. 0: no state.
using Version = std::uint64_t;

// Returns a number that was never returned before; thread-safe.
inline Version next_version() {
    static std::atomic<Version> last = 0;
    return ++last;
}

// A value with the number of its state.
template <class T>
class Versioned {
  public:
    const T& get() const { return value_; }
    Version version() const { return version_; }  // 0: nothing was set yet
    void set(T value) {
        value_ = std::move(value);
        version_ = next_version();
    }

  private:
    T value_{};
    Version version_ = 0;
};

}  // namespace nephos
