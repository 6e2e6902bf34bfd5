#include "libeditnerf/base/pth_archive.h"

#include <torch/types.h>

#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/restricted_pickle.h"
#include "libeditnerf/base/stored_zip.h"
#include "tests/catch.h"
#include "tests/pickle_writer.h"
#include "tests/shared_data.h"

using namespace editnerf;
using namespace editnerf::testing;

namespace {

const std::vector<float> kValues = {0, 1, 2, 3, 4, 5};

std::string TwoTensors() {
  const std::string storage = Storage("FloatStorage", "7", 6);
  return DictPickle({{"whole", TensorOf(storage, 0, {2, 3}, {3, 1})}, {"column", TensorOf(storage, 1, {2}, {3})}});
}

std::string LegacyOf(const std::string& tensor) {
  return LegacyFile(DictPickle({{"w", tensor}}), {{"7", StorageData(kValues)}});
}

std::string MessageFor(const std::string& content) {
  const auto path = Scratch("hostile.pth", content);
  try {
    ReadPthArchive(path);
  } catch (const DataError& error) {
    CHECK_THAT(error.what(), HasText(path.string() + ": "));
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("weights are read from the legacy layout with their strides") {
  const auto tensors = ReadPthArchive(Scratch("legacy.pth", LegacyFile(TwoTensors(), {{"7", StorageData(kValues)}})));
  REQUIRE(tensors.size() == 2);
  CHECK(torch::equal(tensors.at("whole"), torch::arange(6, torch::kFloat32).view({2, 3})));
  CHECK(torch::equal(tensors.at("column"), torch::tensor({1.0f, 4.0f})));
}

TEST_CASE("weights are read from the zip layout") {
  const std::string data = StorageData(kValues).substr(8);
  const auto tensors =
      ReadPthArchive(Scratch("zip.pth", StoredZip({{"archive/data.pkl", TwoTensors()}, {"archive/data/7", data}})));
  REQUIRE(tensors.size() == 2);
  CHECK(torch::equal(tensors.at("column"), torch::tensor({1.0f, 4.0f})));
}

TEST_CASE("ordered dicts of pairs, parameters and attributes are understood") {
  const std::string tensor = TensorOf(Storage("FloatStorage", "7", 6), 0, {6}, {1});
  const std::string parameter = Global("torch._utils", "_rebuild_parameter") + Tuple({tensor, "\x88", "N"}) + "R";
  const std::string pair = "](" + Text("w") + parameter + "e";
  const std::string dict = kProto + Global("collections", "OrderedDict") + Tuple({"](" + pair + "e"}) + "R" + "}" +
                           Text("_metadata") + "}s" + "b.";
  const auto tensors = ReadPthArchive(Scratch("ordered.pth", LegacyFile(dict, {{"7", StorageData(kValues)}})));
  CHECK(torch::equal(tensors.at("w"), torch::arange(6, torch::kFloat32)));
}

TEST_CASE("a pickle that names a function is refused with the function's name, and nothing runs") {
  const auto marker = ScratchFolder() / "ran";
  const std::string call = Global("os", "system") + Tuple({Text("touch " + marker.string())}) + "R";
  const std::string message = MessageFor(LegacyFile(DictPickle({{"w", call}}), {}));
  CHECK_THAT(message, HasText("asks for 'os.system', which is not loaded; allowed are collections.OrderedDict"));
  CHECK_FALSE(std::filesystem::exists(marker));
  const std::string stacked = Text("posix") + Text("system") + "\x93" + Tuple({Text("true")}) + "R";
  CHECK_THAT(MessageFor(StoredZip({{"a/data.pkl", DictPickle({{"w", stacked}})}})), HasText("asks for 'posix.system'"));
  CHECK_THAT(MessageFor(LegacyFile(DictPickle({{"w", Global("torch", "FloatStorage") + ")R"}}), {})),
             HasText("a call of 'torch.FloatStorage'"));
}

TEST_CASE("a file cut at any byte is refused") {
  const std::string legacy = LegacyFile(TwoTensors(), {{"7", StorageData(kValues)}});
  const std::string zip =
      StoredZip({{"archive/data.pkl", TwoTensors()}, {"archive/data/7", StorageData(kValues).substr(8)}});
  for (const std::string& whole : {legacy, zip}) {
    for (size_t length = 0; length < whole.size(); length += 7)
      CHECK(MessageFor(whole.substr(0, length)) != "no error");
    CHECK(MessageFor(whole.substr(0, whole.size() - 1)) != "no error");
  }
}

TEST_CASE("lengths that the file does not hold are refused before memory is taken") {
  const int64_t huge = std::numeric_limits<int64_t>::max();
  const std::string storage = Storage("FloatStorage", "7", 6);
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, 0, {7}, {1}))), HasText("reaches beyond its storage of 6 elements"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, 5, {2}, {1}))), HasText("reaches beyond"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, 0, {huge, huge, huge}, {huge, huge, huge}))),
             HasText("reaches beyond"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, 0, {huge}, {0}))), HasText("reaches beyond"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, huge, {0}, {1}))), HasText("begins beyond"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, -1, {1}, {1}))), HasText("a tensor's offset: found -1"));
  CHECK_THAT(MessageFor(LegacyOf(TensorOf(storage, 0, {2, 3}, {1}))), HasText("2 sizes and 1 strides"));

  const std::string big = DictPickle({{"w", TensorOf(Storage("DoubleStorage", "7", huge), 0, {1}, {1})}});
  CHECK_THAT(MessageFor(LegacyFile(big, {{"7", LittleEndian(static_cast<uint64_t>(huge), 8)}})),
             HasText("storage '7' has 9223372036854775807 elements of 8 bytes, but 0 bytes are left"));
  CHECK_THAT(MessageFor(StoredZip({{"a/data.pkl", big}, {"a/data/7", ""}})), HasText("but 0 bytes are left"));
  CHECK_THAT(MessageFor(kMagic + kProto + "X" + LittleEndian(0xffffffff, 4)),
             HasText("4294967295 bytes expected, 0 left"));
}

TEST_CASE("inconsistent pickles are refused") {
  const auto dict = [](const std::string& body) { return LegacyFile(kProto + body + ".", {}); };
  CHECK_THAT(MessageFor(dict("h\x05")), HasText("memo 5 was never written"));
  CHECK_THAT(MessageFor(dict("u")), HasText("no mark on the stack"));
  CHECK_THAT(MessageFor(dict("")), HasText("the stack is empty"));
  CHECK_THAT(MessageFor(dict("}K\x01s")), HasText("the stack is empty"));
  CHECK_THAT(MessageFor(dict("}(K\x01u")), HasText("a key but no value"));
  CHECK_THAT(MessageFor(dict("K\x01K\x02"
                             "a")),
             HasText("found an integer, expected a list"));
  CHECK_THAT(MessageFor(dict("i")), HasText("opcode 0x69"));
  CHECK_THAT(MessageFor(dict("K\x01")), HasText("found an integer, expected a dict of tensors"));
  CHECK_THAT(MessageFor(LegacyFile(DictPickle({{"epoch", Int(3)}}), {})), HasText("entry 'epoch' is an integer"));
  CHECK_THAT(MessageFor(LegacyFile(TwoTensors(), {})), HasText("the data of 'whole' is missing"));
  CHECK_THAT(MessageFor(LegacyFile(TwoTensors(), {{"8", ""}})), HasText("storage '8' belongs to no tensor"));
  // A list that holds itself is only odd; a pickle that copies one list a thousand times over is an attack.
  CHECK_THAT(MessageFor(dict("]q\x01h\x01"
                             "a")),
             HasText("found a list, expected a dict of tensors"));
  std::string copies = "](";
  for (int i = 0; i < 50; ++i) copies += "K\x01K\x02\x86";
  copies += "eq\x01";
  for (int i = 0; i < 1000; ++i) copies += Global("collections", "OrderedDict") + "h\x01\x85R0";
  CHECK_THAT(MessageFor(dict(copies)), HasText("more entries of ordered dicts than the file has bytes"));
}

TEST_CASE("a short pickle can take neither much memory nor much time") {
  const auto repeated = [](const std::string& part, size_t times) {
    std::string all;
    for (size_t i = 0; i < times; ++i) all += part;
    return all;
  };
  const auto message = [](const std::string& body) {
    try {
      ReadPickle(kProto + body + ".", "p");
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  // A value of 150 bytes for every byte of the file.
  CHECK_THAT(message(repeated("N", 1100000)), HasText("more than 1048576 opcodes"));
  // A key of half a megabyte, copied for every storage.
  const std::string key = Text(std::string(500000, 'k')) + "q\x01";
  CHECK_THAT(
      message(key + Tuple({Text("storage"), Global("torch", "FloatStorage"), "h\x01", Text("cpu"), Int(1)}) + "Q"),
      HasText("a storage's key of 500000 bytes, expected at most 256"));
  // A tuple of 250,000 arguments, copied for every call: half a minute.
  const std::string tensor = TensorOf(Storage("FloatStorage", "7", 1), 0, {1}, {1}) + "q\x04";
  CHECK(message(tensor + Global("torch._utils", "_rebuild_parameter") + "q\x01(h\x04" + repeated("N", 250000) +
                "tq\x05" + repeated("h\x01h\x05R", 100000)) == "no error");
}

TEST_CASE("a pickle or an archive with any byte changed is read or refused, never worse") {
  const std::string pickle = TwoTensors();
  const std::string zip = StoredZip({{"archive/data.pkl", "some bytes"}, {"archive/data/7", "others"}});
  int64_t num_refused = 0;
  for (const bool is_zip : {false, true}) {
    const std::string& whole = is_zip ? zip : pickle;
    for (size_t at = 0; at < whole.size(); ++at) {
      for (const unsigned char flip : {0x01, 0x80, 0xff, 0x5a}) {
        std::string changed = whole;
        changed[at] = static_cast<char>(static_cast<unsigned char>(changed[at]) ^ flip);
        try {
          if (is_zip) {
            ReadStoredZip(changed, "changed");
          } else {
            ReadPickle(changed, "changed");
          }
        } catch (const DataError&) {
          ++num_refused;
        }
      }
    }
  }
  CHECK(num_refused > 100);
}

TEST_CASE("other files and other zip archives are refused") {
  CHECK_THAT(MessageFor("hello"), HasText("not a file written by torch.save"));
  CHECK_THAT(MessageFor(StoredZip({{"a/b", "c"}})), HasText("without data.pkl"));
  CHECK_THAT(MessageFor(StoredZip({{"a/data.pkl", "c"}}, 8)), HasText("'a/data.pkl' is compressed"));
  CHECK_THAT(MessageFor(StoredZip({{"a/x", "c"}, {"a/x", "c"}})), HasText("two entries are called 'a/x'"));
  CHECK_THAT(MessageFor(StoredZip({{"a/data.pkl", TwoTensors()}, {"a/byteorder", "big"}})),
             HasText("byte order 'big'"));
  CHECK_THROWS_WITH(ReadPthArchive("/nowhere/w.pth"), "/nowhere/w.pth: no such file");
}

TEST_CASE("published weights are read whole") {
  const auto shared = SharedData();
  if (!shared) {
    WARN("skipped: no shared data beside the checkout");
    return;
  }
  const auto count = [&](const char* file, size_t num_tensors, int64_t num_parameters) {
    const auto tensors = ReadPthArchive(*shared / "weights" / file);
    CHECK(tensors.size() == num_tensors);
    int64_t total = 0;
    for (const auto& [name, tensor] : tensors) {
      CHECK(torch::isfinite(tensor).all().item<bool>());
      total += tensor.numel();
    }
    CHECK(total == num_parameters);
  };
  count("raft-small.pth", 106, 990162);
  count("lpips-squeeze-backbone.pth", 50, 722496);
  count("lpips-squeeze-linear-v0.1.pth", 7, 64 + 128 + 256 + 384 + 384 + 512 + 512);
}
