#include "libeditnerf/imaging/npy_file.h"

#include <cctype>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr size_t kMagicSize = 8;  // "\x93NUMPY", major, minor
constexpr size_t kAlignment = 64;
constexpr size_t kMaxDimensions = 32;

struct NpyHeader {
  std::string descr;
  bool fortran_order = false;
  std::vector<int64_t> shape;
};

// The header is a Python dictionary literal with three known keys; this reads that and nothing more.
class HeaderParser {
 public:
  HeaderParser(const std::string& text, const std::string& where) : text_(text), where_(where) {}

  NpyHeader Parse() {
    NpyHeader header;
    bool seen[3] = {false, false, false};
    Expect('{');
    while (!Accept('}')) {
      const std::string key = String();
      Expect(':');
      if (key == "descr") {
        seen[0] = true;
        if (Peek() != '\'' && Peek() != '"') {
          Throw<DataError>("{}: expected a plain array, found one with fields", where_);
        }
        header.descr = String();
      } else if (key == "fortran_order") {
        seen[1] = true;
        header.fortran_order = Boolean();
      } else if (key == "shape") {
        seen[2] = true;
        header.shape = Shape();
      } else {
        Fail();
      }
      if (!Accept(',') && Peek() != '}') Fail();
    }
    if (Peek() != '\0' || !(seen[0] && seen[1] && seen[2])) Fail();
    return header;
  }

 private:
  [[noreturn]] void Fail() const { Throw<DataError>("{}: damaged .npy header near character {}", where_, position_); }
  char Peek() {
    while (position_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[position_])) != 0) ++position_;
    return position_ < text_.size() ? text_[position_] : '\0';
  }
  bool Accept(char c) {
    if (Peek() != c) return false;
    ++position_;
    return true;
  }
  void Expect(char c) {
    if (!Accept(c)) Fail();
  }
  std::string String() {
    const char quote = Peek();
    if (quote != '\'' && quote != '"') Fail();
    const size_t end = text_.find(quote, position_ + 1);
    if (end == std::string::npos) Fail();
    std::string value = text_.substr(position_ + 1, end - position_ - 1);
    position_ = end + 1;
    return value;
  }
  bool Boolean() {
    Peek();
    for (const bool value : {true, false}) {
      const std::string word = value ? "True" : "False";
      if (text_.compare(position_, word.size(), word) == 0) {
        position_ += word.size();
        return value;
      }
    }
    Fail();
  }
  std::vector<int64_t> Shape() {
    std::vector<int64_t> shape;
    Expect('(');
    while (!Accept(')')) {
      if (std::isdigit(static_cast<unsigned char>(Peek())) == 0) Fail();
      int64_t size = 0;
      while (position_ < text_.size() && std::isdigit(static_cast<unsigned char>(text_[position_])) != 0) {
        size = 10 * size + (text_[position_++] - '0');
        if (size > (int64_t{1} << 40)) Fail();
      }
      shape.push_back(size);
      if (shape.size() > kMaxDimensions) Fail();
      if (!Accept(',') && Peek() != ')') Fail();
    }
    return shape;
  }

  const std::string& text_;
  const std::string& where_;
  size_t position_ = 0;
};

size_t ElementSize(const std::string& descr, const std::string& where) {
  static const std::map<std::string, size_t> kSizes = {{"<f4", 4}, {"<f8", 8}, {"<i2", 2}, {"<i4", 4}, {"<i8", 8},
                                                       {"<u2", 2}, {"<u4", 4}, {"|i1", 1}, {"|u1", 1}, {"|b1", 1}};
  const auto found = kSizes.find(descr);
  if (found != kSizes.end()) return found->second;
  if (!descr.empty() && descr[0] == '>') {
    Throw<DataError>("{}: big-endian values ('{}'); save the array in little endian", where, descr);
  }
  if (descr.find('O') != std::string::npos) {
    Throw<DataError>("{}: holds pickled Python objects, which are never loaded; save a numeric array", where);
  }
  Throw<DataError>("{}: values of type '{}'; expected float32, float64, bool or integers", where, descr);
}

template <class From>
torch::Tensor Widened(const char* data, const std::vector<int64_t>& shape, torch::ScalarType type) {
  torch::Tensor wide = torch::empty(shape, torch::kInt64);
  auto* out = wide.data_ptr<int64_t>();
  for (int64_t i = 0; i < wide.numel(); ++i) {
    From value;
    std::memcpy(&value, data + static_cast<size_t>(i) * sizeof(From), sizeof(From));
    out[i] = value;
  }
  return wide.to(type);
}

std::string Descr(const torch::Tensor& array) {
  switch (array.scalar_type()) {
    case torch::kFloat32:
      return "<f4";
    case torch::kFloat64:
      return "<f8";
    case torch::kInt16:
      return "<i2";
    case torch::kInt32:
      return "<i4";
    case torch::kInt64:
      return "<i8";
    case torch::kInt8:
      return "|i1";
    case torch::kUInt8:
      return "|u1";
    case torch::kBool:
      return "|b1";
    default:
      Throw<ShapeError>("npy: tensors of type {} are not written", c10::toString(array.scalar_type()));
  }
}

torch::ScalarType TypeOf(const std::string& descr) {
  static const std::map<std::string, torch::ScalarType> kTypes = {
      {"<f4", torch::kFloat32}, {"<f8", torch::kFloat64}, {"<i2", torch::kInt16}, {"<i4", torch::kInt32},
      {"<i8", torch::kInt64},   {"|i1", torch::kInt8},    {"|u1", torch::kUInt8}, {"|b1", torch::kBool}};
  return kTypes.at(descr);
}

}  // namespace

torch::Tensor ReadNpy(const std::filesystem::path& path, uintmax_t max_bytes) {
  const std::string where = path.string();
  const std::string content = ReadFile(path, max_bytes);
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<unsigned char>(content[i])); };
  if (content.size() < kMagicSize + 2 || content.compare(0, 6, "\x93NUMPY") != 0) {
    Throw<DataError>("{}: not a .npy file", where);
  }
  const size_t version = byte(6);
  if (version < 1 || version > 3) Throw<DataError>("{}: .npy version {}, expected 1, 2 or 3", where, version);
  const size_t length_size = version == 1 ? 2 : 4;
  size_t data_start = kMagicSize + length_size;
  size_t length = 0;
  for (size_t i = 0; i < length_size && kMagicSize + i < content.size(); ++i) length |= byte(kMagicSize + i) << (8 * i);
  if (data_start > content.size() || length > content.size() - data_start) {
    Throw<DataError>("{}: ends inside its header", where);
  }
  const std::string text = content.substr(data_start, length);
  const NpyHeader header = HeaderParser(text, where).Parse();
  data_start += length;

  const size_t element = ElementSize(header.descr, where);
  if (header.fortran_order && header.shape.size() > 1) {
    Throw<DataError>("{}: in Fortran order; save numpy.ascontiguousarray(array)", where);
  }
  const size_t available = content.size() - data_start;
  size_t count = 1;
  bool too_many = false, empty = false;
  for (const int64_t size : header.shape) {
    const auto n = static_cast<size_t>(size);
    empty = empty || n == 0;
    // Neither the product here nor LibTorch's may overflow, also where a zero hides it.
    if (n != 0 && count > (size_t{1} << 40) / n) too_many = true;
    if (n != 0 && !too_many) count *= n;
  }
  if (empty) count = 0;
  if (too_many || count * element != available) {
    Throw<DataError>("{}: the header announces {} values of {} bytes, found {} bytes of data", where,
                     too_many ? std::string("too many") : std::to_string(count), element, available);
  }
  const char* data = content.data() + data_start;
  if (header.descr == "<u2") return Widened<uint16_t>(data, header.shape, torch::kInt32);
  if (header.descr == "<u4") return Widened<uint32_t>(data, header.shape, torch::kInt64);
  torch::Tensor array = torch::empty(header.shape, TypeOf(header.descr));
  if (available > 0) std::memcpy(array.data_ptr(), data, available);
  if (array.scalar_type() == torch::kBool) array = array.view(torch::kUInt8).ne(0);  // other bytes are no valid bool
  return array;
}

void WriteNpy(const std::filesystem::path& path, const torch::Tensor& array) {
  if (!array.defined()) Throw<ShapeError>("npy: {}: no array to write", path.string());
  const torch::Tensor plain = array.detach().to(torch::kCPU).contiguous();
  std::string shape;
  for (const int64_t size : plain.sizes()) shape += std::to_string(size) + (plain.dim() == 1 ? "," : ", ");
  if (plain.dim() > 1) shape.resize(shape.size() - 2);
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", Descr(plain), shape);
  const size_t unpadded = kMagicSize + 2 + header.size() + 1;
  header.append((kAlignment - unpadded % kAlignment) % kAlignment, ' ');
  header += '\n';
  std::string content("\x93NUMPY\x01\x00", kMagicSize);
  content += static_cast<char>(header.size() & 0xff);
  content += static_cast<char>(header.size() >> 8);
  content += header;
  content.append(static_cast<const char*>(plain.data_ptr()), plain.nbytes());
  WriteFileAtomically(path, content);
}

}  // namespace editnerf
