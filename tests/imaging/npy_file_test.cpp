#include "libeditnerf/imaging/npy_file.h"

#include <string>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

// Version 1 with any header text and data.
std::string Npy(const std::string& header, const std::string& data, char major = 1) {
  std::string content("\x93NUMPY", 6);
  content += major;
  content += '\0';
  for (int i = 0; i < (major == 1 ? 2 : 4); ++i) content += static_cast<char>((header.size() >> (8 * i)) & 0xff);
  return content + header + data;
}

std::string ErrorFor(const std::string& content) {
  const ScratchFolder folder;
  WriteText(folder / "a.npy", content);
  const std::string message = MessageOf<DataError>([&] { ReadNpy(folder / "a.npy"); });
  INFO(message);
  CHECK((message == "no error" || message.find((folder / "a.npy").string()) == 0));
  return message;
}

}  // namespace

TEST_CASE("npy files keep type, shape and values") {
  const ScratchFolder folder;
  const auto path = folder / "array.npy";
  for (const auto type : {torch::kFloat32, torch::kFloat64, torch::kInt16, torch::kInt32, torch::kInt64, torch::kInt8,
                          torch::kUInt8, torch::kBool}) {
    for (const std::vector<int64_t>& shape : std::vector<std::vector<int64_t>>{{}, {5}, {0, 3}, {2, 3, 4}}) {
      const torch::Tensor array = (torch::rand(shape, torch::kFloat64) * 3).to(type);
      WriteNpy(path, array);
      CHECK(std::filesystem::file_size(path) % 64 == static_cast<uintmax_t>(array.nbytes()) % 64);
      const torch::Tensor found = ReadNpy(path);
      CHECK(found.scalar_type() == type);
      CHECK(found.sizes() == array.sizes());
      CHECK(torch::equal(found, array));
    }
  }
  WriteNpy(path, torch::arange(6).reshape({2, 3}).t());  // not contiguous
  CHECK(torch::equal(ReadNpy(path), torch::arange(6).reshape({2, 3}).t()));
  CHECK_THROWS_AS(WriteNpy(path, torch::zeros({2}, torch::kComplexFloat)), ShapeError);
}

TEST_CASE("npy files of versions 2 and 3 and of unsigned types are read") {
  const ScratchFolder folder;
  const std::string two_values("\x01\x00\xff\xff", 4);
  for (const char version : {1, 2, 3}) {
    WriteText(folder / "a.npy",
              Npy("{'descr': '<u2', 'fortran_order': False, 'shape': (2,), }\n", two_values, version));
    CHECK(torch::equal(ReadNpy(folder / "a.npy"), torch::tensor({1, 65535}, torch::kInt32)));
  }
}

TEST_CASE("npy files that are hostile or of another kind are refused by name") {
  const std::string four(4, '\0');
  const auto with = [](const std::string& descr, const std::string& fortran, const std::string& shape) {
    return "{'descr': '" + descr + "', 'fortran_order': " + fortran + ", 'shape': " + shape + ", }";
  };
  CHECK(ErrorFor(Npy(with("<f4", "False", "(1,)"), four)) == "no error");
  CHECK_THAT(ErrorFor("hello"), HasText("not a .npy file"));
  CHECK_THAT(ErrorFor(""), HasText("not a .npy file"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(1,)"), four, 9)), HasText("version 9, expected 1, 2 or 3"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "True", "(1, 1)"), four)), HasText("ascontiguousarray"));
  CHECK_THAT(ErrorFor(Npy(with("|O", "False", "(1,)"), four)), HasText("pickled Python objects"));
  CHECK_THAT(ErrorFor(Npy(with(">f4", "False", "(1,)"), four)), HasText("big-endian"));
  CHECK_THAT(ErrorFor(Npy(with("<c8", "False", "(1,)"), four)), HasText("values of type '<c8'"));
  CHECK_THAT(ErrorFor(Npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }", four)),
             HasText("one with fields"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(2,)"), four)),
             HasText("the header announces 2 values of 4 bytes, found 4 bytes of data"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(1000000000000, 1000000000000, 1000000000000)"), four)),
             HasText("announces too many values"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(99999999999999999999,)"), four)), HasText("damaged .npy header"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(-1,)"), four)), HasText("damaged .npy header"));
  CHECK_THAT(ErrorFor(Npy(with("<f4", "False", "(1,"), four)), HasText("damaged .npy header"));
  CHECK_THAT(ErrorFor(Npy("{'descr': '<f4', 'shape': (1,)}", four)), HasText("damaged .npy header"));
  CHECK_THAT(ErrorFor(Npy("__import__('os')", four)), HasText("damaged .npy header"));
  const std::string whole = Npy(with("<f4", "False", "(1,)"), four);
  for (size_t length = 0; length < whole.size(); ++length) CHECK(ErrorFor(whole.substr(0, length)) != "no error");
  const ScratchFolder folder;
  WriteText(folder / "a.npy", whole);
  CHECK_THAT(MessageOf<DataError>([&] { ReadNpy(folder / "a.npy", 10); }), HasText("expected at most 10"));
  CHECK_THAT(MessageOf<DataError>([&] { ReadNpy(folder / "b.npy"); }), HasText("no such file"));
}
