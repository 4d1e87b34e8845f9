// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files of frames, several frames at a time (not installed).

#include <deque>
#include <exception>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "density/export/containers.h"
#include "simulation/export/export_list.h"
#include "simulation/export/sequence.h"

namespace nephos {

// What came of a frame.
struct ExportedFrame {
    FrameFigures figures;
    struct File {
        ExportedFile listed;
        bool kept;  // an earlier export wrote it
    };
    std::vector<File> files;  // in the order of formats
    std::vector<std::string> notes;  // on its source, and on what was in the place of its files
};

// Writes the files of one frame that are not there yet. Thread-safe for different frames.
class FrameExporter {
  public:
    FrameExporter(const ExportOptions& options, ExportList& list) : options_(options), list_(list) {}

    // Throws Error(io) when the frame has another box than its sequence, or a file cannot be written, for lack
    // of memory, too.
    ExportedFrame write(const ExportSequence& s, const SourceFrame& frame, const LoadedDensity& loaded) const;

  private:
    // What formats of a frame share, made when one needs it.
    struct Encodings {
        std::vector<Volume> levels;
        std::map<VoxelType, EncodedVolume> encoded;
    };

    ExportedFrame write_files(const ExportSequence& s, const SourceFrame& frame,
                              const LoadedDensity& loaded) const;
    // Returns whether nothing of the frame is left in the file.
    bool write_format(const std::filesystem::path& path, ExportFormat format, const ExportSequence& s,
                      const SourceFrame& frame, const LoadedDensity& loaded, const ExportSource& source,
                      Encodings& made) const;
    void write_dense(const std::filesystem::path& path, ExportFormat format, const ExportSequence& s,
                     const SourceFrame& frame, const EncodedVolume& encoded) const;

    const ExportOptions& options_;
    ExportList& list_;
    mutable std::mutex cloud_mutex_;  // one largest cloud is looked for at a time
};

// Frames that are written at the same time, so that one is encoded while another is read and a third is flushed to the
// device. They end in their order.
class FramesAtWork {
  public:
    using Finished = std::function<void(ExportedFrame&& frame)>;

    // `most` frames at a time; 1: none is left to a thread of its own.
    FramesAtWork(std::size_t most, Finished finished) : most_(most), finished_(std::move(finished)) {}
    ~FramesAtWork() = default;  // waits for those at work
    FramesAtWork(const FramesAtWork&) = delete;
    FramesAtWork& operator=(const FramesAtWork&) = delete;

    template <typename Work>
    void add(Work work) {
        if (most_ <= 1) return finished_(work());
        if (frames_.size() == most_) finish_first();
        frames_.push_back(std::async(std::launch::async, std::move(work)));
    }
    void finish() {
        while (!frames_.empty()) finish_first();
    }
    // After a failure, whose message is the one to show: what was whole before is taken all the same, up to the first frame
    // that failed, too.
    void finish_quietly() noexcept {
        try {
            finish();
        } catch (const std::exception&) {
        }
    }

  private:
    void finish_first() {
        std::future<ExportedFrame> first = std::move(frames_.front());
        frames_.pop_front();
        finished_(first.get());
    }

    std::size_t most_;
    Finished finished_;
    std::deque<std::future<ExportedFrame>> frames_;
};

// Returns the memory that a frame takes beside its grid: the voxels of its box and of their levels as floats, their codes in
// each type, and what the largest of its files takes while it is made. FlightGear's cloud is not known before it is read.
std::uint64_t box_bytes(const ExportOptions& options, const ExportSequence& sequence);

// Returns a frame more than there are threads to compute with, as one waits for the device most of the time; of large frames
// as many as fit into memory; 1 with one thread.
std::size_t frames_at_once(const ExportOptions& options, const ExportSequence& sequence);

}  // namespace nephos
