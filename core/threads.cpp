// SPDX-License-Identifier: Apache-2.0
#include "core/threads.h"

#include <string_view>
#include <system_error>

namespace nephos {

bool is_lack_of_threads(const std::exception& error) {
    const auto* of_system = dynamic_cast<const std::system_error*>(&error);
    return (of_system != nullptr && of_system->code() == std::errc::resource_unavailable_try_again) ||
           std::string_view(error.what()).starts_with("pthread_create has failed");
}

}  // namespace nephos
