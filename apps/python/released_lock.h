// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>
#include <unistd.h>

namespace nephos {

// Releases the interpreter lock as long as it lives, so that other threads of Python go on. Where the interpreter ends
// meanwhile, as with daemon threads, Python 3.11 ends the thread that wants the lock back by unwinding its stack; this goes
// through a destructor, which may not throw, and would abort the process. So such a thread sleeps until the process has
// ended, as it does by itself from Python 3.14 on. Of pybind11, gil_scoped_release is the same without this.
class ReleasedLock {
  public:
    ReleasedLock() : state_(PyEval_SaveThread()) {}
    ~ReleasedLock() {
        try {
            PyEval_RestoreThread(state_);
        } catch (...) {  // no exception: glibc's unwinding, which ends the process where a handler is left
            while (true) ::pause();
        }
    }
    ReleasedLock(const ReleasedLock&) = delete;
    ReleasedLock& operator=(const ReleasedLock&) = delete;

  private:
    PyThreadState* state_;
};

}  // namespace nephos
