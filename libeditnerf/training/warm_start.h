// What training takes over from pretraining: the static scene, which both fields hold in the same place.
#pragma once

#include <cstdint>

#include "libeditnerf/training/run.h"

namespace editnerf {

// Copies from a pretrained run of the same scene the canonical encoding and the networks behind it, as far as sizes
// agree; of the density network's first layer, the weights of the canonical features alone. What only training has (the
// encoding around key points, their weights) stays as it is. Returns the number of values taken over: none for fields
// of another kind or size, or of another box. Throws ConfigError where `pretrained` is no pretraining.
int64_t TakeOverStaticScene(const Run& pretrained, Run* run);

}  // namespace editnerf
