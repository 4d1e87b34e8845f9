// SPDX-License-Identifier: Apache-2.0
#pragma once

// One stage of work beside the thread that hands it out: a thread of its own, which does one job after the
// other in the order they were given, and a bound on the jobs that are in it.
//
//     Stage<Job> write(2, true, [](Job& job) { ... });
//     Stage<Job> draw(1, true, [&](Job& job) { ...; write.add(std::move(job)); });
//     while (...) draw.add(make_job());
//     draw.finish();
//     write.finish();
//
// A failure travels against the flow: the stage does none of its waiting jobs any more, and the next call of
// whoever hands out to it throws what the work threw; if that is another stage's work, so it goes on to the
// first. The stages behind it still do what they have.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace nephos {

template <typename Job>
class Stage {
  public:
    // Makes a stage of at most `bound` jobs, at least 1: the one that is being done and those that wait.
    // Without `beside` there is no thread: add() does the job itself.
    Stage(std::size_t bound, bool beside, std::function<void(Job&)> work)
        : bound_(bound), work_(std::move(work)) {
        if (beside) thread_ = std::thread([this] { do_jobs(); });
    }
    // Waits for the job that is being done; those that wait are dropped.
    ~Stage() {
        if (!thread_.joinable()) return;
        {
            const std::scoped_lock lock(mutex_);
            ended_ = true;
        }
        changed_.notify_all();
        thread_.join();
    }
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

    // Hands over a job; waits while the stage is full. Throws what the work threw, also for an earlier job.
    void add(Job job) {
        std::unique_lock lock(mutex_);
        ++adding_;
        changed_.wait(lock, [this] { return failure_ || in_stage_ < bound_; });
        --adding_;
        rethrow();
        if (!thread_.joinable()) return do_here(job);
        waiting_.push_back(std::move(job));
        ++in_stage_;
        lock.unlock();
        changed_.notify_all();
    }

    // Returns true when a job waits to be done, or for a place in the stage: for the work, which may leave something
    // undone that the next job does with less effort.
    bool is_awaited() {
        if (!thread_.joinable()) return false;  // add() does the job
        const std::scoped_lock lock(mutex_);
        return !failure_ && (adding_ > 0 || !waiting_.empty());
    }

    // Throws what the work threw, if it did; does not wait.
    void check() {
        const std::scoped_lock lock(mutex_);
        rethrow();
    }

    // Waits until all jobs are done; throws what the work threw.
    void finish() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return in_stage_ == 0; });
        rethrow();
    }

  private:
    void rethrow() const {
        if (failure_) std::rethrow_exception(failure_);
    }

    void do_here(Job& job) {
        try {
            work_(job);
        } catch (...) {
            failure_ = std::current_exception();
            throw;
        }
    }

    void do_jobs() {
        std::unique_lock lock(mutex_);
        while (true) {
            changed_.wait(lock, [this] { return ended_ || !waiting_.empty(); });
            if (ended_) return;
            std::exception_ptr failure;
            {
                Job job = std::move(waiting_.front());
                waiting_.pop_front();
                lock.unlock();
                try {
                    work_(job);
                } catch (...) {
                    failure = std::current_exception();
                }
            }  // what the job holds is free before the next may come in
            lock.lock();
            --in_stage_;
            if (failure) {
                failure_ = failure;
                in_stage_ = 0;
                waiting_.clear();
            }
            changed_.notify_all();
        }
    }

    const std::size_t bound_;
    const std::function<void(Job&)> work_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Job> waiting_;
    std::size_t in_stage_ = 0;  // waiting and being done
    std::size_t adding_ = 0;    // that wait for a place
    bool ended_ = false;
    std::exception_ptr failure_;
    std::thread thread_;  // none when the jobs are done by add()
};

}  // namespace nephos
