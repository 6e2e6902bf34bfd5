// What a measurement was made with: the processor, and the version of this library.
#pragma once

#include <string>

namespace editnerf {

// "Intel(R) Xeon(R) ...", as the system names it; empty where it does not.
std::string ProcessorName();

std::string LibraryVersion();  // "0.1.0"

// Short name of the commit that was built, with "-dirty" where files differed from it; empty where the sources were no
// checkout.
std::string LibraryCommit();

// Spent by this process so far, all threads together: what other load on the machine changes least.
double ProcessorSeconds();
double ThreadSeconds();  // by the calling one alone

// Largest resident set of this process so far, bytes.
long PeakResidentBytes();

}  // namespace editnerf
