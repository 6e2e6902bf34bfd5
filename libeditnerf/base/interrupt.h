// Ctrl-C as a flag that long loops look at, so that they can write a checkpoint before they stop.
#pragma once

namespace editnerf {

// SIGINT and SIGTERM set the flag; a second signal ends the process at once. Called by programs, never by the library.
void InstallInterruptHandler();

bool InterruptRequested();
void RequestInterrupt();  // what the handler does; for tests and embedding programs
void ClearInterrupt();

}  // namespace editnerf
