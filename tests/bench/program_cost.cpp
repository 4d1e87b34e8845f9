// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/program_cost.h"

#include <stdexcept>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/bench/bench_row.h"

namespace nephos::bench {
namespace {

double milliseconds(const timeval& time) { return double(time.tv_sec) * 1e3 + double(time.tv_usec) * 1e-3; }

}  // namespace

Cost cost_of(const std::vector<std::string>& arguments) {
    std::vector<char*> argv;
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    int status = 0;
    rusage usage{};
    const double wall = time_ms([&] {
        const pid_t child = ::fork();
        if (child == 0) {
            const int nowhere = ::open("/dev/null", O_WRONLY);
            ::dup2(nowhere, 1);
            ::dup2(nowhere, 2);
            ::execv(argv[0], argv.data());
            ::_exit(127);
        }
        if (child < 0 || ::wait4(child, &status, 0, &usage) != child || status != 0)
            throw std::runtime_error(fmt::format("failed: {}", fmt::join(arguments, " ")));
    });
    return {wall, milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime),
            double(usage.ru_maxrss) / 1024};
}

}  // namespace nephos::bench
