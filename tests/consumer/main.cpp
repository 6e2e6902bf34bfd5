// Uses the installed library as another project would: a configuration, and tensors in a file.
#include <torch/torch.h>

#include <iostream>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/config/yaml.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: consumer FILE\n";
    return 2;
  }
  try {
    editnerf::Config config = editnerf::LoadConfigText("train: {steps: 100}", "consumer.yaml");
    editnerf::ApplyOverride(config, "field.kind=fast");
    const torch::Tensor key_points = torch::rand({3, 3});
    editnerf::WriteSafetensors(argv[1], {{"key_points", key_points}}, {{"config", editnerf::ToYaml(config)}});
    const editnerf::SafetensorsFile file = editnerf::ReadSafetensors(argv[1]);
    const editnerf::Config read = editnerf::LoadConfigText(file.metadata.at("config"), argv[1]);
    const bool same = torch::equal(file.tensors.at("key_points"), key_points) && read.train.steps == 100;
    std::cout << (same ? "consumer: as written\n" : "consumer: DIFFERENT\n");
    return same ? 0 : 1;
  } catch (const editnerf::Error& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
