// SPDX-License-Identifier: Apache-2.0
#include "study/workers.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <span>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr int kPoll_ms = 100;

// A message: a number and some bytes. To a worker: the task. From it: 0 with a result, 1 with the message of a failure.
struct Head {
    std::uint64_t number = 0, bytes = 0;
};

bool read_all(int fd, void* to, std::size_t bytes) {
    char* at = static_cast<char*>(to);
    while (bytes > 0) {
        const ssize_t got = ::read(fd, at, bytes);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got;
        bytes -= std::size_t(got);
    }
    return true;
}

// Without a signal where nobody reads any more.
bool send_all(int fd, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t sent = ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent < 0) return false;
        bytes = bytes.subspan(std::size_t(sent));
    }
    return true;
}

bool send_message(int fd, std::uint64_t number, const std::string& content) {
    const Head head{number, content.size()};
    return send_all(fd, std::as_bytes(std::span(&head, 1))) &&
           send_all(fd, std::as_bytes(std::span(content)));
}

struct Worker {
    pid_t process = -1;
    Descriptor socket;
    std::optional<std::uint64_t> task;
};

// Ctrl-C and the end of a terminal go to the whole group, and the SIGTERM of a batch system to every process of a job, in any
// order. The parent decides what is kept: a worker that ended before it had heard would count as a failed run.
constexpr int kEndings[] = {SIGINT, SIGTERM, SIGHUP};

// The life of a worker; it ends when its parent does.
[[noreturn]] void serve(int fd, const Task& task) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const int signal : kEndings) ::signal(signal, SIG_IGN);
    sigset_t none;
    sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    Head head;
    while (read_all(fd, &head, sizeof head)) {
        std::string result;
        std::uint64_t failed = 0;
        try {
            result = task(head.number);
        } catch (const std::bad_alloc&) {
            failed = 1;
            result = "out of memory";
        } catch (const std::exception& error) {
            failed = 1;
            result = error.what();
        }
        if (!send_message(fd, failed, result)) break;
    }
    ::_exit(0);  // no destructors: what they would flush belongs to the parent
}

Worker start(const Task& task, const std::vector<Worker>& others) {
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
        throw Error(ErrorCode::io, fmt::format("cannot start a worker: {}", std::strerror(errno)));
    Worker worker;
    worker.socket.reset(ends[0]);
    const Descriptor other(ends[1]);
    // What comes before the worker ignores it waits, and is dropped then.
    sigset_t ends_us, before;
    sigemptyset(&ends_us);
    for (const int signal : kEndings) sigaddset(&ends_us, signal);
    ::sigprocmask(SIG_BLOCK, &ends_us, &before);
    worker.process = ::fork();
    if (worker.process != 0) ::sigprocmask(SIG_SETMASK, &before, nullptr);
    if (worker.process < 0)
        throw Error(ErrorCode::io, fmt::format("cannot start a worker: {}", std::strerror(errno)));
    if (worker.process == 0) {
        // The ends of the others would keep their workers alive after the parent has gone.
        worker.socket.close();
        for (const Worker& sibling : others)
            if (sibling.socket.get() >= 0) ::close(sibling.socket.get());
        serve(other.get(), task);
    }
    return worker;
}

std::string end_of(Worker& worker) {
    worker.socket.close();
    int status = 0;
    pid_t ended = 0;
    do {
        ended = ::waitpid(worker.process, &status, 0);
    } while (ended < 0 && errno == EINTR);
    worker.process = -1;
    if (ended < 0) return "its process ended";  // SIGCHLD is ignored: the system does not say how
    if (WIFSIGNALED(status))
        return fmt::format("its process was ended by signal {} ({}){}", WTERMSIG(status),
                           ::strsignal(WTERMSIG(status)),
                           WTERMSIG(status) == SIGKILL ? ": perhaps it took too much memory" : "");
    return fmt::format("its process ended with status {}", WEXITSTATUS(status));
}

class Pool {
  public:
    Pool(const WorkerOptions& options, const Task& task) : options_(options), task_(task) {
        for (int n = 0; n < options.count; ++n) {
            Worker worker = start(task_, workers_);
            workers_.push_back(std::move(worker));
        }
    }
    ~Pool() {
        for (Worker& worker : workers_) {
            if (worker.process < 0) continue;
            ::kill(worker.process,
                   SIGKILL);  // also an idle one, which may be stopped: it has nothing to flush
            end_of(worker);
        }
    }
    Pool(const Pool&) = delete;
    Pool& operator=(const Pool&) = delete;

    bool run(const std::function<std::optional<std::uint64_t>()>& next, const TaskEnd& end) {
        bool more = true;
        while (true) {
            for (Worker& worker : workers_)
                if (more && !worker.task) more = give(worker, next());
            std::vector<pollfd> polled;
            std::vector<Worker*> waiting;
            for (Worker& worker : workers_) {
                if (!worker.task) continue;
                polled.push_back({worker.socket.get(), POLLIN, 0});
                waiting.push_back(&worker);
            }
            if (polled.empty()) return true;
            ::poll(polled.data(), polled.size(), kPoll_ms);
            if (options_.stop && options_.stop()) return false;
            for (std::size_t n = 0; n < polled.size(); ++n)
                if (polled[n].revents != 0) receive(*waiting[n], end);
            if (options_.idle) options_.idle();
        }
    }

  private:
    bool give(Worker& worker, std::optional<std::uint64_t> task) {
        if (!task) return false;
        worker.task = task;
        if (send_message(worker.socket.get(), *task, {})) return true;
        // It ended while it had nothing to do, or the system has no room for a message.
        ::kill(worker.process, SIGKILL);
        end_of(worker);
        worker = start(task_, workers_);
        worker.task = task;
        if (!send_message(worker.socket.get(), *task, {}))
            throw Error(ErrorCode::io,
                        fmt::format("cannot hand a run to a worker: {}", std::strerror(errno)));
        return true;
    }

    void receive(Worker& worker, const TaskEnd& end) {
        const std::uint64_t task = *worker.task;
        Head head;
        std::string content;
        bool whole = read_all(worker.socket.get(), &head, sizeof head);
        if (whole) {
            content.resize(head.bytes);
            whole = read_all(worker.socket.get(), content.data(), content.size());
        }
        worker.task.reset();
        if (whole) {
            end(task, content, head.number == 0 ? std::nullopt : std::optional(content));
            return;
        }
        const std::string failure = end_of(worker);
        worker = start(task_, workers_);
        end(task, {}, failure);
    }

    const WorkerOptions& options_;
    const Task& task_;
    std::vector<Worker> workers_;
};

}  // namespace

bool work(const WorkerOptions& options, const std::function<std::optional<std::uint64_t>()>& next,
          const Task& task, const TaskEnd& end) {
    Pool pool(options, task);
    return pool.run(next, end);
}

}  // namespace nephos
