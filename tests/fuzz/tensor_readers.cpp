#include <torch/types.h>

#include "libeditnerf/base/pth_archive.h"
#include "libeditnerf/base/restricted_pickle.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/stored_zip.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/scene/packed_scene.h"
#include "libeditnerf/training/depth_targets.h"
#include "tests/fuzz/readers.h"
#include "tests/fuzz/small_scene.h"
#include "tests/pickle_writer.h"

namespace editnerf::fuzz {
namespace {

using Inputs = std::vector<std::string>;

void ReadSafetensorsInput(const std::string& input) { ReadSafetensors(InputFile("a.safetensors", input)); }

Inputs SafetensorsSeeds() {
  const auto path = InputFolder() / "seed.safetensors";
  const torch::Tensor tensor = torch::arange(6, torch::kFloat32).view({2, 3});
  WriteSafetensors(path, {{"a", tensor}, {"b", tensor.to(torch::kInt64)}, {"c", tensor.gt(2)}}, {{"key", "value"}});
  Inputs seeds = {FileContent(path)};
  WriteSafetensors(path, {{"none", torch::empty({0, 3})}, {"half", tensor.to(torch::kBFloat16)}});
  seeds.push_back(FileContent(path));
  return seeds;
}

void ReadPackedSceneInput(const std::string& input) { LoadPackedScene(InputFile("a.packed", input)); }

Inputs PackedSceneSeeds() {
  const auto path = InputFolder() / "seed.packed";
  SavePackedScene(SmallScene(), path);
  return {FileContent(path)};
}

void ReadDepthTargetsInput(const std::string& input) {
  ReadDepthTargets(InputFile("still_depth.safetensors", input), 2, 3, 4, 1);
}

Inputs DepthTargetsSeeds() {
  const auto path = InputFolder() / "seed.safetensors";
  WriteDepthTargets(path, {torch::tensor({0, 1}, torch::kInt64), torch::tensor({{0, 2}, {3, 1}}, torch::kInt64),
                           torch::tensor({1.5f, 2.0f}), torch::tensor({0.1f, 0.2f}),
                           torch::tensor({kNotCarried, int64_t{0}}, torch::kInt64)});
  return {FileContent(path)};
}

void ReadNpyInput(const std::string& input) { ReadNpy(InputFile("a.npy", input)); }

Inputs NpySeeds() {
  const auto path = InputFolder() / "seed.npy";
  Inputs seeds;
  for (const auto type : {torch::kFloat32, torch::kInt16, torch::kBool}) {
    WriteNpy(path, torch::arange(6).view({2, 3}).to(type));
    seeds.push_back(FileContent(path));
  }
  const std::string header = "{'descr': '<u2', 'fortran_order': False, 'shape': (2,), }\n";
  seeds.push_back(std::string("\x93NUMPY\x02\x00", 8) + testing::LittleEndian(header.size(), 4) + header + "abcd");
  return seeds;
}

void ReadPthInput(const std::string& input) {
  for (const auto& [name, tensor] : ReadPthArchive(InputFile("a.pth", input))) tensor.clone();
}

Inputs PthSeeds() {
  using namespace testing;
  const std::string storage = Storage("FloatStorage", "7", 6);
  const std::string parameter =
      Global("torch._utils", "_rebuild_parameter") + Tuple({TensorOf(storage, 0, {6}, {1}), "\x88", "N"}) + "R";
  const std::string dict =
      DictPickle({{"w", TensorOf(storage, 0, {2, 3}, {3, 1})}, {"column", TensorOf(storage, 1, {2}, {3})}});
  const std::string ordered =
      kProto + Global("collections", "OrderedDict") + Tuple({"](](" + Text("p") + parameter + "ee"}) + "R.";
  const std::string data = StorageData({0, 1, 2, 3, 4, 5});
  return {LegacyFile(dict, {{"7", data}}), LegacyFile(ordered, {{"7", data}}),
          StoredZip({{"a/data.pkl", dict}, {"a/data/7", data.substr(8)}, {"a/byteorder", "little"}})};
}

// The parts of the archive by themselves, from memory: most changes to a whole file only break its frame.
void ReadPickleInput(const std::string& input) { ReadPickle(input, InputFolder().string()); }

Inputs PickleSeeds() {
  using namespace testing;
  const std::string tensor = TensorOf(Storage("FloatStorage", "7", 6), 0, {2, 3}, {3, 1});
  return {DictPickle({{"w", tensor}}),
          kProto + "](K\x01M\x01\x02J\x01\x02\x03\x04NGabcdefgh" + "\x88\x89)eq\x01h\x01\x85.",
          "\x80\x04\x95" + LittleEndian(9, 8) + "}\x94\x8c\x01" + "a\x8c\x04" + "textsj" + LittleEndian(0, 4) + "0."};
}

void ReadZipInput(const std::string& input) { ReadStoredZip(input, InputFolder().string()); }

Inputs ZipSeeds() { return {testing::StoredZip({{"a/b", "content"}, {"a/c", ""}})}; }

}  // namespace

std::vector<Reader> TensorReaders() {
  return {{"safetensors", ReadSafetensorsInput, SafetensorsSeeds},
          {"packed_scene", ReadPackedSceneInput, PackedSceneSeeds},
          {"depth_targets", ReadDepthTargetsInput, DepthTargetsSeeds},
          {"npy", ReadNpyInput, NpySeeds},
          {"pth", ReadPthInput, PthSeeds},
          {"pickle", ReadPickleInput, PickleSeeds},
          {"zip", ReadZipInput, ZipSeeds}};
}

}  // namespace editnerf::fuzz
