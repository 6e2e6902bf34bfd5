// Published weights of RAFT, as they are published.
//
//   the authors' files       names as in network.h, behind "module."; torch.save's legacy layout
//   torchvision's            the same networks under other names (raft_small, raft_large); torch.save's zip layout
//   safetensors              either set of names
// Whether the network is the small or the large one is read off the file. Nothing in a file is executed.
#pragma once

#include <filesystem>
#include <string>

#include "libeditnerf/tracking/raft/network.h"

namespace editnerf {

// The name in network.h of a tensor in any of those files; a name that none of them has is returned as it is.
std::string RaftParameterName(const std::string& published);

// A network in evaluation mode, without gradients. Throws DataError naming the file: unreadable, a tensor that is
// missing, unknown, of another shape or not finite.
Raft LoadRaft(const std::filesystem::path& path);

}  // namespace editnerf
