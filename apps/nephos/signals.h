// SPDX-License-Identifier: Apache-2.0
#pragma once

// Ctrl-C and SIGTERM: the first asks for an orderly end (finish the step, leave a checkpoint), the second,
// unless it comes within 0.3 s, ends the process at once. Also makes failed writes visible as errors where the default is a silent death.

namespace nephos {

// Installs the handlers; call once at the start of main(). SIGPIPE and SIGXFSZ are ignored, so that a closed
// pipe and a file-size limit appear as EPIPE and EFBIG at the write that met them.
void install_signal_handlers();

// From now on the first SIGINT or SIGTERM is only remembered; until this is called it ends the process at
// once, since there is nothing to save.
void defer_signals();

// The signal that asked for an end, or 0. Async-signal-safe and thread-safe.
int pending_signal();

}  // namespace nephos
