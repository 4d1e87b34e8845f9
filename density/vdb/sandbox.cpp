// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/sandbox.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <fstream>
#include <limits>
#include <new>
#include <sstream>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/text.h"
#include "core/threads.h"
#include "density/vdb/confinement.h"
#include "density/vdb/sanitized.h"

#if NEPHOS_SANITIZED
#include <cstdio>
#include <cstdlib>

#include <sanitizer/common_interface_defs.h>
#include <sys/syscall.h>

namespace {

// Ends a child whose sanitizer has reported, so that its parent knows it from one that stumbled over its file. Not by _exit(), where
// ThreadSanitizer would wait for the report to end.
constexpr int kReported = 86;
bool is_child = false;
void end_reported() {
    if (is_child) ::syscall(SYS_exit_group, kReported);
}

}  // namespace

// Called by ThreadSanitizer, which goes on after a report.
extern "C" void __tsan_on_report(void*) { end_reported(); }

// Asked by GCC's sanitizer of undefined behaviour, which beside AddressSanitizer has no callback of its own: the number is kReported.
extern "C" const char* __ubsan_default_options() { return "exitcode=86"; }
#endif

namespace nephos {
namespace {

// In the child of a sanitized build.
void begin_reports() {
#if NEPHOS_SANITIZED
    is_child = true;
    __sanitizer_set_death_callback(end_reported);
#endif
}

// In the parent of such a build: a report is a fault of the program, and none of the file's for which there are errors.
void end_if_reported([[maybe_unused]] int status) {
#if NEPHOS_SANITIZED
    if (!WIFEXITED(status) || WEXITSTATUS(status) != kReported) return;
    std::fputs("a sanitizer has ended the process that reads a file\n", stderr);
    std::abort();
#endif
}

using Clock = std::chrono::steady_clock;

// The stream is a sequence of chunks: a 32-bit length, then the bytes. Two lengths are signs.
constexpr std::uint32_t kEnd = 0;  // all sent
constexpr std::uint32_t kFailure =
    std::numeric_limits<std::uint32_t>::max();  // a message follows as one chunk
constexpr std::size_t kChunk = std::size_t{1} << 18;
constexpr std::size_t kMaxText = std::size_t{1} << 16;
constexpr int kMaxAttempts = 3;
constexpr auto kStallTime = std::chrono::seconds(8);
constexpr const char* kTooLong = "cannot read: it takes longer than allowed";

// The time that reading may take. It is asked twice a second while the child is waited for: where much more has passed between
// two looks, this process was stopped (Ctrl-Z, a batch system), and the child with it or for want of a reader. That is
// not the child's time.
class TimeAllowed {
  public:
    explicit TimeAllowed(double seconds)
        : left_(std::chrono::milliseconds(static_cast<long long>(seconds * 1000))) {}

    // Takes off what has passed since the last look.
    void count() {
        const Clock::time_point now = Clock::now();
        left_ -= std::min<Clock::duration>(now - looked_, kLongestLook);
        looked_ = now;
    }
    // A look that takes nothing off.
    void skip() { looked_ = Clock::now(); }
    Clock::duration left() const { return left_; }
    bool is_over() const { return left_ <= Clock::duration::zero(); }

  private:
    static constexpr auto kLongestLook = std::chrono::seconds(2);
    Clock::duration left_;
    Clock::time_point looked_ = Clock::now();
};

// Thrown inside run_sandboxed when the child seems to wait for a lock that nobody holds, asleep or not.
struct Stalled {};

// In the child.
void send_all(int fd, const void* data, std::size_t size) {
    if (write_all(fd, {static_cast<const std::byte*>(data), size}) != 0)
        ::_exit(1);  // nobody listens any more
}

[[noreturn]] void run_child(pid_t parent, int fd, const SandboxLimits& limits, std::span<const int> kept,
                            const std::function<void(SandboxWriter&)>& child) {
    try {
        std::vector<int> open(kept.begin(), kept.end());
        open.push_back(fd);
        begin_reports();
        // A child before this one that was ended has left the position of the files where it was.
        for (const int file : kept)
            if (::lseek(file, 0, SEEK_SET) != 0 && errno != ESPIPE)
                throw std::runtime_error(std::string(kCannotRead) + std::strerror(errno));
        confine(parent, open, limits.memory_bytes, limits.seconds);
        SandboxWriter writer(fd);
        child(writer);
        writer.finish();
    } catch (const std::bad_alloc&) {
        SandboxWriter(fd).fail(too_large(limits.memory_bytes));
    } catch (const std::exception& error) {
        SandboxWriter(fd).fail(error.what());
    } catch (...) {
        SandboxWriter(fd).fail("unknown failure");
    }
    ::_exit(0);
}

// Returns the state letter and processor time of a process; '?' when unknown.
std::pair<char, long> process_state(pid_t pid) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string line;
    std::getline(stat, line);
    const std::size_t name_end = line.rfind(')');
    if (name_end == std::string::npos) return {'?', 0};
    std::istringstream fields(line.substr(name_end + 1));
    char state = '?';
    long skipped = 0, user = 0, system = 0;
    fields >> state;
    for (int n = 0; n < 10; ++n) fields >> skipped;
    fields >> user >> system;
    return {state, user + system};
}

class PipeReader final : public SandboxReader {
  public:
    PipeReader(int fd, pid_t pid, const SandboxLimits& limits, TimeAllowed& time, bool last_attempt)
        : fd_(fd),
          pid_(pid),
          memory_(limits.memory_bytes),
          most_(limits.most_bytes),
          time_(time),
          quiet_seconds_(limits.quiet_seconds),
          quiet_(limits.quiet_seconds),
          may_restart_(!last_attempt),
          quiet_since_(Clock::now()) {}

    void bytes(void* data, std::size_t size) override {
        char* out = static_cast<char*>(data);
        while (size > 0) {
            if (left_ == 0) next_chunk();
            const std::size_t part = std::min(size, left_);
            receive(out, part);
            out += part;
            size -= part;
            left_ -= part;
        }
    }

    std::size_t memory_bytes() const override { return memory_; }

    void expect_end() {
        std::uint32_t length = 0;
        if (left_ == 0) receive(&length, sizeof length);
        if (length == kFailure) fail();
        if (left_ != 0 || length != kEnd)
            throw std::runtime_error("the reading process sent more than expected");
    }

  private:
    void next_chunk() {
        std::uint32_t length = 0;
        receive(&length, sizeof length);
        if (length == kFailure) fail();
        if (length == kEnd || length > kChunk)
            throw std::runtime_error("the reading process sent less than expected");
        left_ = length;
    }

    [[noreturn]] void fail() {
        std::uint32_t length = 0;
        receive(&length, sizeof length);
        std::string message(std::min<std::size_t>(length, kMaxText), ' ');
        receive(message.data(), message.size());
        throw std::runtime_error(message);
    }

    void receive(void* data, std::size_t size) {
        if (size > most_)  // a bound of memory, of which the file may be innocent
            throw std::runtime_error(std::string(kCannotRead) +
                                     "its content takes more than is allowed of memory");
        most_ -= size;
        char* out = static_cast<char*>(data);
        while (size > 0) {
            if (at_ == arrived_) refill();
            const std::size_t part = std::min(size, arrived_ - at_);
            std::memcpy(out, buffer_.data() + at_, part);
            at_ += part;
            out += part;
            size -= part;
        }
    }

    // Reads what has come: values of a few bytes one by one would cost two system calls each.
    void refill() {
        // Leaves out what the caller did with the last of it: that is not the child's time.
        time_.skip();
        quiet_ = TimeAllowed(quiet_seconds_);
        for (;;) {
            wait_for_data();
            time_.count();
            const ssize_t got = ::read(fd_, buffer_.data(), buffer_.size());
            if (got < 0 && errno == EINTR) continue;
            if (got < 0)
                throw std::runtime_error(std::string(kCannotRead) +
                                         "cannot hear the reading process: " + std::strerror(errno));
            if (got == 0) throw std::runtime_error("");  // the child is gone: its status says why
            may_restart_ = false;
            at_ = 0;
            arrived_ = std::size_t(got);
            return;
        }
    }

    void wait_for_data() {
        for (;;) {
            time_.count();
            quiet_.count();
            if (time_.is_over()) throw std::runtime_error(kTooLong);
            if (quiet_.is_over()) {
                if (may_restart_) throw Stalled();
                throw std::runtime_error(kTooLong);
            }
            const Clock::duration least = std::min(time_.left(), quiet_.left());
            const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(least).count() + 1;
            pollfd poll_fd{fd_, POLLIN, 0};
            const int ready = ::poll(&poll_fd, 1, int(std::min<long long>(left, 500)));
            if (ready > 0) return;
            if (ready < 0 && errno != EINTR)
                throw std::runtime_error(std::string(kCannotRead) +
                                         "cannot hear the reading process: " + std::strerror(errno));
            if (ready == 0 && may_restart_) check_stall();
        }
    }

    void check_stall() {
        const auto [state, used] = process_state(pid_);
        if (state != 'S' || used != used_) {
            quiet_since_ = Clock::now();
            used_ = used;
        } else if (Clock::now() - quiet_since_ > kStallTime) {
            throw Stalled();
        }
    }

    int fd_;
    pid_t pid_;
    std::size_t memory_;
    std::size_t most_;  // bytes that may still come
    TimeAllowed& time_;
    const double quiet_seconds_;
    TimeAllowed quiet_;
    bool may_restart_;  // nothing has come, and it is not the last attempt
    Clock::time_point quiet_since_;
    long used_ = -1;
    std::size_t left_ = 0;  // bytes of the present chunk that were not yet taken
    std::vector<char> buffer_ = std::vector<char>(kChunk);
    std::size_t at_ = 0, arrived_ = 0;  // bytes of the buffer that were taken, and that are there
};

// Ends the child whatever happens, so that no process stays behind.
class Child {
  public:
    Child(pid_t pid, std::string_view parser) : pid_(pid), parser_(parser) {}
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;
    ~Child() { kill(); }

    void kill() {
        if (pid_ <= 0) return;
        ::kill(pid_, SIGKILL);
        has_ended(0);
    }

    // Waits for its end, which it may put off for ever, and kills it when its time is over. Returns how it ended, in words,
    // "" when as it should.
    std::string end_within(TimeAllowed& time) {
        while (!has_ended(WNOHANG)) {
            time.count();
            if (time.is_over()) {
                kill();
                return kTooLong;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return how_it_ended();
    }

  private:
    bool has_ended(int options) {
        pid_t result;
        do {
            result = ::waitpid(pid_, &status_, options);
        } while (result < 0 && errno == EINTR);
        if (result == 0) return false;
        if (result < 0) status_ = 0;  // unknown
        pid_ = -1;
        end_if_reported(status_);
        return true;
    }

    // None of it is a verdict: a parser that stumbles over damage and one that is refused memory end alike.
    std::string how_it_ended() const {
        const int status = status_;
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
        if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) return kTooLong;
        const std::string begin(kCannotRead);
        // The system's answer to memory that is short, in the machine or in a control group.
        if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
            return begin + "the system killed the process that read it, as it does where memory is short";
        const std::string how =
            WIFSIGNALED(status) ? " ended with signal " + std::to_string(WTERMSIG(status)) : " ended";
        return begin + parser_ + how + ": the file is damaged, or memory is short";
    }

    pid_t pid_;
    int status_ = 0;
    std::string parser_;
};

void attempt(std::string_view parser, const SandboxLimits& limits, std::span<const int> kept,
             TimeAllowed& time, bool last_attempt, const std::function<void(SandboxWriter&)>& child,
             const std::function<void(SandboxReader&)>& parent) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) {
        throw std::runtime_error(std::string(kCannotRead) +
                                 "no pipe to a reading process: " + std::strerror(errno));
    }
    Descriptor out(ends[0]), in(ends[1]);
    ::fcntl(ends[1], F_SETPIPE_SZ, 1 << 20);  // fewer turns of both; without the right to it the pipe is small
    const pid_t self = ::getpid(), pid = ::fork();
    if (pid < 0)
        throw std::runtime_error(std::string(kCannotRead) +
                                 "no process to read it in: " + std::strerror(errno));
    if (pid == 0) {
        // Ends it here where there is no memory for its last word: what called this is the parent's, and not to be gone back through.
        try {
            run_child(self, ends[1], limits, kept, child);
        } catch (...) {
            ::_exit(1);
        }
    }
    in.close();
    Child process(pid, parser);
    PipeReader reader(out.get(), pid, limits, time, last_attempt);
    try {
        parent(reader);
        reader.expect_end();
    } catch (const std::runtime_error& error) {
        if (*error.what() != '\0') throw;
        const std::string how = process.end_within(time);
        throw std::runtime_error(how.empty() ? std::string(kCannotRead) + "the reading process ended early"
                                             : how);
    }
    process.kill();  // all has come: there is nothing to wait for
}

}  // namespace

void SandboxWriter::bytes(const void* data, std::size_t size) {
    const auto* at = static_cast<const std::byte*>(data);
    while (size > 0) {
        const std::size_t part = std::min(size, kChunk - buffer_.size());
        buffer_.insert(buffer_.end(), at, at + part);
        at += part;
        size -= part;
        if (buffer_.size() == kChunk) flush();
    }
}

void SandboxWriter::text(std::string_view text) {
    text = text.substr(0, kMaxText);
    value(std::uint32_t(text.size()));
    bytes(text.data(), text.size());
}

void SandboxWriter::flush() {
    if (buffer_.empty()) return;
    const auto length = std::uint32_t(buffer_.size());
    send_all(fd_, &length, sizeof length);
    send_all(fd_, buffer_.data(), buffer_.size());
    buffer_.clear();
}

void SandboxWriter::finish() {
    flush();
    send_all(fd_, &kEnd, sizeof kEnd);
}

void SandboxWriter::fail(std::string_view message) {
    message = message.substr(0, kMaxText);
    const auto length = std::uint32_t(message.size());
    send_all(fd_, &kFailure, sizeof kFailure);
    send_all(fd_, &length, sizeof length);
    send_all(fd_, message.data(), message.size());
}

std::string SandboxReader::text() {
    const auto size = value<std::uint32_t>();
    if (size > kMaxText) throw std::runtime_error("the reading process sent a text that is too long");
    std::string result(size, ' ');
    bytes(result.data(), result.size());
    return result;
}

std::string too_large(std::size_t memory_bytes) {
    return std::string(kCannotRead) + "it takes more than the " + std::to_string(memory_bytes >> 20) +
           " MiB of memory that are allowed";
}

std::string clamp_message(std::string_view text, std::size_t length) {
    std::string result;
    for (char c : text.substr(0, length)) {
        const auto code = static_cast<unsigned char>(c);
        result += code >= 0x20 && code < 0x7F ? c : '?';
    }
    if (text.size() > length) result += "...";
    return result;
}

std::string clamp_text(std::string_view text, std::size_t length) {
    std::string result;
    for (std::size_t at = 0; at < text.size();) {
        const Character next = character_at(text, at);
        if (result.size() + next.bytes.size() > length) return result + "...";
        result += next.valid ? next.bytes : std::string_view("?");
        at += next.bytes.size();
    }
    return result;
}

void run_sandboxed(const std::filesystem::path& subject, std::string_view parser, const SandboxLimits& limits,
                   std::span<const int> kept, const std::function<void(SandboxWriter&)>& child,
                   const std::function<void(SandboxReader&)>& parent) {
    for (const double seconds : {limits.seconds, limits.quiet_seconds}) {
        if (!(seconds > 0 && seconds <= 1e6))
            throw Error(ErrorCode::usage, "time limit of " + number_text(seconds, 6) +
                                              " s: must be above 0, at most 1,000,000");
    }
    TimeAllowed time(limits.seconds);
    for (int n = 1; n <= kMaxAttempts; ++n) {
        try {
            attempt(parser, limits, kept, time, n == kMaxAttempts, child, parent);
            return;
        } catch (const Stalled&) {
        } catch (const Error&) {
            throw;
        } catch (const std::bad_alloc&) {
            throw;  // of this process
        } catch (const std::exception& error) {
            if (is_lack_of_threads(error)) throw;  // likewise
            const std::string message = clamp_message(error.what());
            if (message.starts_with(kCannotRead))
                throw ReadFailure(subject, message.substr(kCannotRead.size()));
            throw Error(ErrorCode::io, subject.string() + ": " + message);
        }
    }
}

}  // namespace nephos
