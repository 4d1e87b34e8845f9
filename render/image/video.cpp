// SPDX-License-Identifier: Apache-2.0
#include "render/image/video.h"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"

extern char** environ;

namespace nephos {
namespace {

constexpr const char* kNoFfmpeg =
    "the ffmpeg command was not found: install the package ffmpeg to write videos";

// The file itself, which ffmpeg opens under this name: what another may have put in the place of its path stays as it is.
constexpr int kOutput = 3;
constexpr const char* kOutputName = "file:/dev/fd/3";

Descriptor opened(const std::filesystem::path& file, const std::filesystem::path& reported) {
    Descriptor descriptor(::open(file.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC));
    if (descriptor.get() < 0)
        throw Error(ErrorCode::io, reported.string() + ": cannot open: " + std::strerror(errno));
    return descriptor;
}

// The running command. Its input is a socket rather than a pipe: writing to a dead reader is then an error
// code (MSG_NOSIGNAL) and not a SIGPIPE, whatever the program around us does with signals.
class Encoder {
  public:
    // `output` becomes the command's descriptor kOutput.
    Encoder(const std::vector<std::string>& command, const Descriptor& output, const VideoOptions& options)
        : stop_(options.stop) {
        int ends[2];
        if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
            fail_system("cannot start ffmpeg", errno);
        ours_.reset(ends[0]);
        const Descriptor theirs(ends[1]);
        messages_.reset(::memfd_create("ffmpeg-messages", MFD_CLOEXEC));
        progress_.reset(::memfd_create("ffmpeg-progress", MFD_CLOEXEC));
        if (messages_.get() < 0 || progress_.get() < 0) fail_system("cannot start ffmpeg", errno);
        spawn(command, theirs.get(), output.get());
        if (options.processors > 0) keep_to(options.processors);
    }
    Encoder(const Encoder&) = delete;
    Encoder& operator=(const Encoder&) = delete;

    // Without finish() an error has occurred elsewhere: kills the command.
    ~Encoder() {
        if (child_ <= 0) return;
        ::kill(child_, SIGKILL);
        wait();
    }

    // False when the command has stopped reading: finish() then says why.
    bool write(std::span<const std::uint8_t> bytes) {
        while (!bytes.empty()) {
            const ssize_t sent = ::send(ours_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
            if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
                require_going_on();
                constexpr int kLook_ms = 100;
                pollfd ours{ours_.get(), POLLOUT, 0};
                ::poll(&ours, 1, kLook_ms);
                continue;
            }
            if (sent < 0 && errno == EINTR) continue;
            if (sent < 0) return false;
            bytes = bytes.subspan(std::size_t(sent));
        }
        return true;
    }

    // Ends the input and waits. Throws Error(io) unless the command succeeded and says that it encoded `frames`: some
    // take an input that cannot be read for one that ends.
    void finish(std::size_t frames) {
        ours_.close();
        constexpr auto kLook = std::chrono::milliseconds(10);
        while (stop_ && is_running()) {
            require_going_on();
            std::this_thread::sleep_for(kLook);
        }
        const std::optional<int> end = wait();
        if (!end)
            throw Error(ErrorCode::io,
                        "how ffmpeg ended cannot be asked: expected a process that does not ignore SIGCHLD");
        const int status = *end;
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
            const std::size_t encoded = frames_encoded();
            if (encoded == frames) return;
            throw Error(ErrorCode::io, "ffmpeg encoded " + std::to_string(encoded) + " of " +
                                           std::to_string(frames) + " frames: " + last_message());
        }
        const std::string how = WIFSIGNALED(status)
                                    ? "was killed by signal " + std::to_string(WTERMSIG(status))
                                    : "failed with status " + std::to_string(WEXITSTATUS(status));
        throw Error(ErrorCode::io, "ffmpeg " + how + ": " + last_message());
    }

  private:
    [[noreturn]] static void fail_system(const std::string& what, int error) {
        throw Error(ErrorCode::io, what + ": " + std::strerror(error));
    }

    void spawn(const std::vector<std::string>& command, int input, int output) {
        std::vector<char*> arguments;
        for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
        arguments.push_back(nullptr);
        posix_spawn_file_actions_t actions;
        posix_spawnattr_t attributes;
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawnattr_init(&attributes);
        ::posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
        ::posix_spawn_file_actions_adddup2(&actions, progress_.get(), STDOUT_FILENO);
        ::posix_spawn_file_actions_adddup2(&actions, messages_.get(), STDERR_FILENO);
        ::posix_spawn_file_actions_adddup2(&actions, output, kOutput);
        // A process group of its own: Ctrl-C at the terminal signals the calling program, which then ends
        // ffmpeg.
        ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
        const int error =
            ::posix_spawnp(&child_, arguments[0], &actions, &attributes, arguments.data(), environ);
        ::posix_spawn_file_actions_destroy(&actions);
        ::posix_spawnattr_destroy(&attributes);
        if (error == 0) return;
        child_ = -1;
        if (error == ENOENT) throw Error(ErrorCode::io, kNoFfmpeg);
        fail_system("cannot start ffmpeg", error);
    }

    // Lets the command run on so many of our processors alone; its threads, which it starts later, inherit them. A
    // system that refuses is no failure: the video only takes more of it.
    void keep_to(int processors) {
        cpu_set_t allowed;
        if (::sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
        for (int cpu = 0, surplus = CPU_COUNT(&allowed) - processors; cpu < CPU_SETSIZE && surplus > 0;
             ++cpu) {
            if (!CPU_ISSET(cpu, &allowed)) continue;
            CPU_CLR(cpu, &allowed);
            --surplus;
        }
        ::sched_setaffinity(child_, sizeof allowed, &allowed);
    }

    void require_going_on() const {
        if (stop_ && stop_()) throw Error(ErrorCode::io, "ffmpeg was stopped before it had ended");
    }

    bool is_running() const {
        siginfo_t info{};
        return ::waitid(P_PID, id_t(child_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
    }

    // Nothing where the system does not tell, as to a process that ignores SIGCHLD.
    std::optional<int> wait() {
        int status = 0;
        pid_t ended = 0;
        do {
            ended = ::waitpid(child_, &status, 0);
        } while (ended < 0 && errno == EINTR);
        child_ = -1;
        return ended < 0 ? std::nullopt : std::optional(status);
    }

    static std::string end_of(const Descriptor& file) {
        char text[600];
        const off_t end = ::lseek(file.get(), 0, SEEK_END);
        const off_t start = end > off_t(sizeof text) ? end - off_t(sizeof text) : 0;
        const ssize_t count = ::pread(file.get(), text, sizeof text, start);
        return std::string(text, count > 0 ? std::size_t(count) : 0);
    }

    // The number in the last line "frame=N" of the command's report of progress.
    std::size_t frames_encoded() {
        constexpr std::string_view kKey = "frame=";
        const std::string report = end_of(progress_);
        const std::size_t at = report.rfind(kKey);
        std::size_t frames = 0;
        if (at != report.npos)
            std::from_chars(report.data() + at + kKey.size(), report.data() + report.size(), frames);
        return frames;
    }

    std::string last_message() {
        std::string message = end_of(messages_);
        while (!message.empty() && (message.back() == '\n' || message.back() == ' ')) message.pop_back();
        return message.empty() ? "no message" : message;
    }

    std::function<bool()> stop_;
    pid_t child_ = -1;
    Descriptor ours_, messages_, progress_;
};

void check(const VideoOptions& options) {
    const auto require = [](bool good, const char* what) {
        if (!good) throw Error(ErrorCode::usage, std::string("video: ") + what);
    };
    require(options.width >= 1 && options.width <= 16384, "width must be 1..16384 pixels");
    require(options.height >= 1 && options.height <= 16384, "height must be 1..16384 pixels");
    require(options.frames_per_second >= kLeastVideoRate && options.frames_per_second <= 1000,
            "frames_per_second must be 0.00005..1000");
    require(options.processors >= 0, "processors must be 0 or more");
    require(options.quality >= 0 && options.quality <= 51, "quality must be 0..51");
}

// Threads of x264: their number changes the file, so it is the same on every machine and with every --threads.
constexpr const char* kEncoderThreads = "4";

std::vector<std::string> command_line(const VideoOptions& options) {
    char rate[32];
    const auto end =
        std::to_chars(rate, rate + sizeof rate, options.frames_per_second, std::chars_format::fixed, 6);
    return {"ffmpeg", "-hide_banner", "-loglevel", "error", "-nostdin", "-y", "-xerror", "-progress",
            "pipe:1", "-stats_period", "1000000", "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
            std::to_string(options.width) + "x" + std::to_string(options.height), "-framerate",
            std::string(rate, end.ptr), "-filter_threads", kEncoderThreads, "-i", "pipe:0",
            // yuv420p, the one layout every player takes, halves the chroma: sides must be even.
            "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p",
            "-c:v", "libx264", "-threads", kEncoderThreads, "-crf", std::to_string(options.quality),
            "-preset", "medium", "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc",
            "iec61966-2-1", "-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact",
            "-metadata", "comment=" + options.comment, "-f", "mp4", kOutputName};
}

}  // namespace

void require_ffmpeg() {
    // Searches the PATH as posix_spawnp() does.
    const char* variable = std::getenv("PATH");
    std::string_view rest = variable != nullptr ? variable : "/bin:/usr/bin";
    while (true) {
        const std::string_view folder = rest.substr(0, rest.find(':'));
        const std::filesystem::path command = std::filesystem::path(folder.empty() ? "." : folder) / "ffmpeg";
        std::error_code error;
        if (std::filesystem::is_regular_file(command, error) && ::access(command.c_str(), X_OK) == 0) return;
        if (folder.size() == rest.size()) throw Error(ErrorCode::io, kNoFfmpeg);
        rest.remove_prefix(folder.size() + 1);
    }
}

struct VideoWriter::Impl {
    Impl(const std::filesystem::path& to, const VideoOptions& o)
        : path(to), options(o), file(to), encoder(command_line(o), opened(file.temporary(), to), o) {}

    // Throws Error(io), with ffmpeg's message where it left one.
    void finish_encoder() {
        try {
            encoder.finish(frames);
        } catch (const Error& error) {
            throw Error(ErrorCode::io, path.string() + ": " + error.what());
        }
    }

    std::filesystem::path path;
    VideoOptions options;
    AtomicFile file;
    Encoder encoder;  // after the file: ends before it is removed
    std::size_t frames = 0;
};

VideoWriter::VideoWriter(const std::filesystem::path& path, const VideoOptions& options) {
    check(options);
    impl_ = std::make_unique<Impl>(path, options);
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::add(std::span<const std::uint8_t> rgb) {
    if (rgb.size() != 3 * std::size_t(impl_->options.width) * std::size_t(impl_->options.height))
        throw Error(ErrorCode::usage, impl_->path.string() + ": the frames of a video must have one size");
    ++impl_->frames;
    if (impl_->encoder.write(rgb)) return;
    impl_->finish_encoder();
    throw Error(ErrorCode::io, impl_->path.string() + ": ffmpeg stopped reading before the last frame");
}

void VideoWriter::finish() {
    if (impl_->frames == 0)
        throw Error(ErrorCode::usage, impl_->path.string() + ": a video needs at least one frame");
    impl_->finish_encoder();
    impl_->file.publish();
}

}  // namespace nephos
