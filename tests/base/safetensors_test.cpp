#include "libeditnerf/base/safetensors.h"

#include <sys/resource.h>
#include <torch/types.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "tests/catch.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

// An empty folder that goes away with the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    path_ = (fs::temp_directory_path() / "editnerf_safetensors_XXXXXX").string();
    REQUIRE(::mkdtemp(path_.data()) != nullptr);
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  fs::path operator/(const std::string& name) const { return fs::path(path_) / name; }
  int64_t FileCount() const { return std::distance(fs::directory_iterator(path_), fs::directory_iterator()); }

 private:
  std::string path_;
};

std::string FileOf(const std::string& header, const std::string& data) {
  const uint64_t length = header.size();
  return std::string(reinterpret_cast<const char*>(&length), 8) + header + data;
}

// The message, without the path, of the CheckpointError that these bytes cause.
std::string ReadError(const std::string& bytes) {
  const TemporaryFolder folder;
  const fs::path path = folder / "hostile.safetensors";
  WriteFileAtomically(path, bytes);
  try {
    ReadSafetensors(path);
  } catch (const CheckpointError& error) {
    const std::string text = error.what(), prefix = path.string() + ": ";
    REQUIRE(text.rfind(prefix, 0) == 0);
    return text.substr(prefix.size());
  }
  return "no error";
}

std::string HeaderError(const std::string& header, const std::string& data = "") {
  return ReadError(FileOf(header, data));
}

}  // namespace

TEST_CASE("safetensors keep every dtype, shape and value") {
  const TemporaryFolder folder;
  std::map<std::string, torch::Tensor> tensors;
  for (const auto type : {torch::kFloat64, torch::kFloat32, torch::kFloat16, torch::kBFloat16, torch::kInt64,
                          torch::kInt32, torch::kInt16, torch::kInt8, torch::kUInt8, torch::kBool}) {
    const std::string name = c10::toString(type);
    const torch::Tensor values = type == torch::kBool ? torch::rand({3, 5}) > 0.5 : torch::rand({3, 5}) * 100;
    tensors[name] = values.to(type);
    tensors[name + ".scalar"] = torch::ones({}, type);
    tensors[name + ".empty"] = torch::ones({0, 4}, type);
    tensors[name + ".strided"] = values.to(type).t();
  }
  const std::map<std::string, std::string> metadata = {
      {"format", "1"}, {"config", "train:\n  \"steps\": 3\n"}, {"ä", "ö"}};
  WriteSafetensors(folder / "all.safetensors", tensors, metadata);
  const SafetensorsFile file = ReadSafetensors(folder / "all.safetensors");
  CHECK(file.metadata == metadata);
  CHECK(ReadSafetensorsMetadata(folder / "all.safetensors") == metadata);
  REQUIRE(file.tensors.size() == tensors.size());
  for (const auto& [name, tensor] : tensors) {
    INFO(name);
    REQUIRE(file.tensors.count(name) == 1);
    const torch::Tensor& read = file.tensors.at(name);
    CHECK(read.scalar_type() == tensor.scalar_type());
    CHECK(read.sizes() == tensor.sizes());
    CHECK(read.is_contiguous());
    CHECK(torch::equal(read, tensor));
  }
}

TEST_CASE("safetensors have the published layout") {
  const TemporaryFolder folder;
  WriteSafetensors(folder / "a", {{"x", torch::tensor({1, 2}, torch::kUInt8)}}, {{"k", "v"}});
  const std::string header = R"({"__metadata__":{"k":"v"},"x":{"data_offsets":[0,2],"dtype":"U8","shape":[2]}})";
  std::string padded = header;
  padded.resize((header.size() + 7) / 8 * 8, ' ');
  CHECK(ReadFile(folder / "a") == FileOf(padded, "\x01\x02"));
}

TEST_CASE("a safetensors file may hold nothing") {
  const TemporaryFolder folder;
  WriteSafetensors(folder / "a", {});
  const SafetensorsFile file = ReadSafetensors(folder / "a");
  CHECK(file.tensors.empty());
  CHECK(file.metadata.empty());
}

TEST_CASE("special values and gradients do not stand in the way of saving") {
  const TemporaryFolder folder;
  const torch::Tensor values =
      torch::tensor({1.0, -0.0, double(INFINITY), double(NAN)}, torch::kFloat64).requires_grad_();
  WriteSafetensors(folder / "a", {{"x", values}});
  const torch::Tensor read = ReadSafetensors(folder / "a").tensors.at("x");
  CHECK_FALSE(read.requires_grad());
  CHECK(torch::equal(read.view(torch::kInt64), values.detach().view(torch::kInt64)));
}

TEST_CASE("a truncated or damaged safetensors file says so") {
  const std::string good = R"({"x":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})";
  const std::string data(8, '\0');
  CHECK(HeaderError(good, data) == "no error");
  CHECK(ReadError("abc") == "3 bytes, expected a safetensors file, which has at least 8");
  CHECK(ReadError("") == "0 bytes, expected a safetensors file, which has at least 8");
  CHECK(ReadError(std::string(16, '\xff')) ==
        "its header claims 18446744073709551615 bytes, but 8 follow; the file is truncated or not a safetensors file");
  CHECK(HeaderError(good, data.substr(1)) ==
        "7 bytes of tensors, its header promises 8; the file is truncated or damaged");
  CHECK(HeaderError(good, data + "x") == "9 bytes of tensors, its header promises 8; the file is truncated or damaged");
  CHECK(HeaderError("{\"x\":", data).find("its header: expected JSON: parse error at line 1") == 0);
  CHECK(HeaderError("[]") == "its header is not a JSON object");
  CHECK(HeaderError("").find("its header: expected JSON: parse error at line 1") == 0);
  CHECK(HeaderError(std::string(1000000, '[')) == "its header: nested deeper than 64 levels");
}

TEST_CASE("a safetensors header must describe its bytes exactly") {
  const auto tensor = [](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return R"({"x":{"dtype":")" + dtype + R"(","shape":)" + shape + R"(,"data_offsets":)" + offsets + "}}";
  };
  const std::string incomplete = "tensor 'x': expected a dtype, a shape and two data_offsets";
  CHECK(HeaderError(tensor("F32", "[2]", "[0,4]"), "0123") ==
        "tensor 'x': data_offsets [0, 4] do not span the 8 bytes of its shape and dtype");
  CHECK(HeaderError(tensor("F32", "[1]", "[4,0]"), "0123") ==
        "tensor 'x': data_offsets [4, 0] do not span the 4 bytes of its shape and dtype");
  CHECK(HeaderError(tensor("F32", "[1]", "[1,5]"), "01234") ==
        "tensor 'x' begins at byte 1, expected 0: tensors overlap or leave a hole");
  CHECK(HeaderError(tensor("F32", "[1]", "[0,4]")) ==
        "0 bytes of tensors, its header promises 4; the file is truncated or damaged");
  CHECK(HeaderError(tensor("C64", "[1]", "[0,8]")) == "tensor 'x': unknown dtype 'C64'");
  CHECK(HeaderError(tensor("F32", "[4294967296,4294967296]", "[0,0]")) == "tensor 'x': its shape overflows");
  CHECK(HeaderError(tensor("F32", "[0,4294967296,4294967296]", "[0,0]")) == "tensor 'x': its shape overflows");
  CHECK(HeaderError(tensor("F32", "[18446744073709551615]", "[0,0]")) == "tensor 'x': its shape overflows");
  CHECK(HeaderError(tensor("F32", "[-1]", "[0,4]")) == incomplete);
  CHECK(HeaderError(tensor("F32", "[1.0]", "[0,4]")) == incomplete);
  CHECK(HeaderError(tensor("F32", "3", "[0,4]")) == incomplete);
  CHECK(HeaderError(tensor("F32", "[1]", "[0,4,8]")) == incomplete);
  CHECK(HeaderError(R"({"x":5})") == incomplete);
  std::string ones = "[1";
  for (int i = 0; i < 40; ++i) ones += ",1";
  CHECK(HeaderError(tensor("U8", ones + "]", "[0,1]"), "x") == "tensor 'x': 41 dimensions, expected at most 32");
  CHECK(HeaderError(tensor("BOOL", "[2]", "[0,2]"), "\x01\x02") == "tensor 'x': expected 0 or 1 in every BOOL");
}

TEST_CASE("overlapping tensors, duplicate names and odd metadata are refused") {
  CHECK(
      HeaderError(
          R"({"x":{"dtype":"U8","shape":[2],"data_offsets":[0,2]},"y":{"dtype":"U8","shape":[2],"data_offsets":[1,3]}})",
          "012") == "tensor 'y' begins at byte 1, expected 2: tensors overlap or leave a hole");
  CHECK(
      HeaderError(
          R"({"x":{"dtype":"U8","shape":[0],"data_offsets":[0,0]},"x":{"dtype":"U8","shape":[0],"data_offsets":[0,0]}})") ==
      "its header: 'x' is given twice");
  CHECK(HeaderError(R"({"__metadata__":{"a":1}})") == "expected a text in __metadata__ 'a'");
  CHECK(HeaderError(R"({"__metadata__":[]})") == "expected an object in __metadata__");
}

TEST_CASE("what safetensors cannot hold is refused before anything is written") {
  const TemporaryFolder folder;
  const fs::path path = folder / "a";
  CHECK_THROWS_AS(WriteSafetensors(path, {{"x", torch::Tensor()}}), CheckpointError);
  CHECK_THROWS_AS(WriteSafetensors(path, {{"x", torch::zeros({1}, torch::kComplexFloat)}}), CheckpointError);
  CHECK_THROWS_AS(WriteSafetensors(path, {{"__metadata__", torch::zeros({1})}}), CheckpointError);
  CHECK_THROWS_AS(WriteSafetensors(path, {{"\xff", torch::zeros({1})}}), CheckpointError);
  CHECK_THROWS_AS(WriteSafetensors(path, {}, {{"a", "\xff"}}), CheckpointError);
  CHECK(folder.FileCount() == 0);
}

TEST_CASE("a missing file, a folder and a place that cannot be written are named") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(ReadSafetensors(folder / "missing"), CheckpointError);
  CHECK_THROWS_AS(ReadSafetensors(folder / ""), CheckpointError);
  const fs::path path = folder / "missing/a.safetensors";
  try {
    WriteSafetensors(path, {{"x", torch::zeros({4})}});
    FAIL("expected an error");
  } catch (const DataError& error) {
    CHECK(error.what() == path.string() + ": cannot be written: No such file or directory");
  }
}

TEST_CASE("a disk that fills up leaves the old checkpoint in place") {
  // A limit on the size of files stands in for the full disk: the write fails in the middle of the data as well.
  const TemporaryFolder folder;
  const fs::path path = folder / "a.safetensors";
  WriteSafetensors(path, {{"x", torch::full({4}, 7.0F)}});
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{4096, before.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  std::string message = "no error";
  try {
    WriteSafetensors(path, {{"x", torch::zeros({100000})}});
  } catch (const DataError& error) {
    message = error.what();
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  CHECK(message == path.string() + ": cannot be written: File too large");
  CHECK(torch::equal(ReadSafetensors(path).tensors.at("x"), torch::full({4}, 7.0F)));
  CHECK(folder.FileCount() == 1);
}

}  // namespace editnerf
