// SPDX-License-Identifier: Apache-2.0
#pragma once

// The text of a check of `nephos verify`. Private to the module.

#include <cstddef>
#include <set>
#include <string>

#include <fmt/format.h>

#include "simulation/verify.h"

namespace nephos {

// Counts problems of one kind, and tells the first of them. The same one is counted once, as that of one source of several files.
class Problems {
  public:
    void add(const std::string& text) {
        if (text == last_ || known_.contains(text)) return;
        last_ = text;
        if (known_.size() < kKnown) known_.insert(text);
        if (++count_ <= kNamed) text_ += (text_.empty() ? "" : "; ") + text;
    }
    bool none() const { return count_ == 0; }
    // The text of the check: the problems, or what is said without any.
    Check check(const std::string& name, const std::string& otherwise) const {
        return {name, none(), none() ? otherwise : text()};
    }
    // A check that the problems keep from being done.
    Check not_done(const std::string& name) const { return {name, false, text(), {}, false}; }

  private:
    static constexpr std::size_t kNamed = 3;       // problems that are told
    static constexpr std::size_t kKnown = 10'000;  // that are compared with all others
    std::string text() const {
        return count_ > kNamed ? fmt::format("{}; and {} more", text_, count_ - kNamed) : text_;
    }
    std::size_t count_ = 0;
    std::string text_, last_;
    std::set<std::string> known_;
};

}  // namespace nephos
