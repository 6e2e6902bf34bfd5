#include "libeditnerf/base/restricted_pickle.h"

#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

using Kind = PickleValue::Kind;

constexpr const char* kAllowed =
    "collections.OrderedDict, torch._utils._rebuild_tensor_v2, torch._utils._rebuild_parameter and torch's storage "
    "types";

// A state dict of a thousand tensors takes sixty thousand. An opcode makes at most one value, of 150 bytes.
constexpr size_t kMaxOpcodes = size_t{1} << 20;
constexpr size_t kMaxKeyLength = 256;  // every tensor of a storage repeats its key
constexpr size_t kMaxTensorAxes = 16;

bool FindGlobal(const std::string& name, PickleValue* value) {
  static const std::unordered_map<std::string, torch::ScalarType> kStorages = {
      {"torch.FloatStorage", torch::kFloat}, {"torch.DoubleStorage", torch::kDouble},
      {"torch.HalfStorage", torch::kHalf},   {"torch.BFloat16Storage", torch::kBFloat16},
      {"torch.LongStorage", torch::kLong},   {"torch.IntStorage", torch::kInt},
      {"torch.ShortStorage", torch::kShort}, {"torch.CharStorage", torch::kChar},
      {"torch.ByteStorage", torch::kByte},   {"torch.BoolStorage", torch::kBool}};
  value->kind = Kind::kGlobal;
  value->text = name;
  if (const auto storage = kStorages.find(name); storage != kStorages.end()) {
    value->global = PickleGlobal::kStorageType;
    value->type = storage->second;
  } else if (name == "collections.OrderedDict") {
    value->global = PickleGlobal::kOrderedDict;
  } else if (name == "torch._utils._rebuild_tensor_v2") {
    value->global = PickleGlobal::kRebuildTensor;
  } else if (name == "torch._utils._rebuild_parameter") {
    value->global = PickleGlobal::kRebuildParameter;
  } else {
    return false;
  }
  return true;
}

// A stack machine over the arena, as the language is defined; marks are positions in the stack.
class Machine {
 public:
  Machine(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Pickle Run() {
    for (size_t num_opcodes = 1; Step(static_cast<unsigned char>(Take(1)[0])); ++num_opcodes) {
      if (num_opcodes > kMaxOpcodes) Fail("more than {} opcodes", kMaxOpcodes);
    }
    Pickle pickle;
    pickle.root = Pop();
    pickle.length = cursor_;
    pickle.values = std::move(values_);
    return pickle;
  }

 private:
  // Executes one opcode; false at STOP. A table, so one opcode a line.
  // clang-format off
  bool Step(unsigned char opcode) {
    switch (opcode) {
      case '.': return false;
      case 0x80:  // PROTO
        if (const uint64_t version = Number(1); version > 5) Fail("pickle protocol {}, expected at most 5", version);
        break;
      case 0x95: Number(8); break;  // FRAME: a hint about buffering
      case '(': marks_.push_back(stack_.size()); break;
      case '0': Pop(); break;
      case '1': PopToMark(); break;
      case 'N': Push(Kind::kNone); break;
      case 0x88: Push(Kind::kBool).integer = 1; break;
      case 0x89: Push(Kind::kBool); break;
      case 'K': Push(Kind::kInt).integer = static_cast<int64_t>(Number(1)); break;
      case 'M': Push(Kind::kInt).integer = static_cast<int64_t>(Number(2)); break;
      case 'J': Push(Kind::kInt).integer = static_cast<int32_t>(Number(4)); break;
      case 0x8a: PushLong(Number(1)); break;
      case 'G': PushDouble(); break;
      case 'U':                                             // SHORT_BINSTRING
      case 0x8c: PushText(Number(1)); break;                // SHORT_BINUNICODE
      case 'T':                                             // BINSTRING
      case 'X': PushText(Number(4)); break;                 // BINUNICODE
      case 0x8d: PushText(Number(8)); break;                // BINUNICODE8
      case ')': Push(Kind::kTuple); break;
      case ']': Push(Kind::kList); break;
      case '}': Push(Kind::kDict); break;
      case 't': PushItems(Kind::kTuple, PopToMark()); break;
      case 'l': PushItems(Kind::kList, PopToMark()); break;
      case 'd': PushItems(Kind::kDict, PopToMark()); break;
      case 0x85: PushItems(Kind::kTuple, PopItems(1)); break;
      case 0x86: PushItems(Kind::kTuple, PopItems(2)); break;
      case 0x87: PushItems(Kind::kTuple, PopItems(3)); break;
      case 'a': Extend(Kind::kList, PopItems(1)); break;
      case 'e': Extend(Kind::kList, PopToMark()); break;
      case 's': Extend(Kind::kDict, PopItems(2)); break;
      case 'u': Extend(Kind::kDict, PopToMark()); break;
      case 'q': memo_[Number(1)] = Top(); break;
      case 'r': memo_[Number(4)] = Top(); break;
      case 0x94: {                                          // MEMOIZE
        const uint64_t slot = memo_.size();
        memo_[slot] = Top();
        break;
      }
      case 'h': Recall(Number(1)); break;
      case 'j': Recall(Number(4)); break;
      case 'c': {                                           // GLOBAL: two lines of text
        const std::string module = Line();
        PushGlobal(module + "." + Line());
        break;
      }
      case 0x93: {                                          // STACK_GLOBAL
        const auto parts = PopItems(2);
        PushGlobal(Text(parts[0], "a module's name") + "." + Text(parts[1], "a global's name"));
        break;
      }
      case 'Q': PushStorage(Pop()); break;                  // BINPERSID
      case 'R': Reduce(); break;
      case 'b':                                             // BUILD: attributes of a dict, which carry no tensors
        Pop();
        Expect(Top(), Kind::kDict, "the object that gets attributes");
        break;
      default: Fail("opcode 0x{:02x}, which files of tensors do not need", opcode);
    }
    return true;
  }
  // clang-format on

  template <class... Args>
  [[noreturn]] void Fail(fmt::format_string<Args...> format, Args&&... args) const {
    Throw<DataError>("{}: pickle, byte {}: {}", name_, cursor_, fmt::format(format, std::forward<Args>(args)...));
  }

  std::string_view Take(uint64_t count) {
    if (count > bytes_.size() - cursor_) {
      Fail("{} bytes expected, {} left: the file is truncated or damaged", count, bytes_.size() - cursor_);
    }
    const std::string_view taken = bytes_.substr(cursor_, count);
    cursor_ += count;
    return taken;
  }

  uint64_t Number(int num_bytes) {  // little-endian, unsigned
    uint64_t number = 0;
    const std::string_view taken = Take(static_cast<uint64_t>(num_bytes));
    for (int i = num_bytes - 1; i >= 0; --i) number = number << 8 | static_cast<unsigned char>(taken[i]);
    return number;
  }

  std::string Line() {
    const size_t end = bytes_.find('\n', cursor_);
    if (end == std::string_view::npos || end - cursor_ > 256) Fail("a global's name without an end");
    std::string line(bytes_.substr(cursor_, end - cursor_));
    cursor_ = end + 1;
    return line;
  }

  PickleValue& Push(Kind kind) {
    stack_.push_back(values_.size());
    values_.emplace_back();
    values_.back().kind = kind;
    return values_.back();
  }

  void PushText(uint64_t length) {
    const std::string_view text = Take(length);
    Push(Kind::kString).text = text;
  }

  void PushItems(Kind kind, std::vector<size_t> items) {
    if (kind == Kind::kDict && items.size() % 2 != 0) Fail("a dict with a key but no value");
    Push(kind).items = std::move(items);
  }

  void PushLong(uint64_t num_bytes) {  // two's complement
    if (num_bytes > 8) Fail("an integer of {} bytes, expected at most 8", num_bytes);
    const uint64_t bits = Number(static_cast<int>(num_bytes));
    const int unused = 64 - 8 * static_cast<int>(num_bytes);
    const bool negative = num_bytes > 0 && (bits >> (63 - unused) & 1) != 0;
    const uint64_t extension = unused == 0 || !negative ? 0 : ~uint64_t{0} << (64 - unused);
    Push(Kind::kInt).integer = static_cast<int64_t>(bits | (unused == 64 ? 0 : extension));
  }

  void PushDouble() {  // big-endian
    uint64_t bits = 0;
    for (const char byte : Take(8)) bits = bits << 8 | static_cast<unsigned char>(byte);
    double real = 0;
    std::memcpy(&real, &bits, sizeof real);
    Push(Kind::kFloat).real = real;
  }

  void PushGlobal(const std::string& global) {
    PickleValue value;
    if (!FindGlobal(global, &value)) {
      Fail("asks for '{}', which is not loaded; allowed are {}; take the weights from their authors", global, kAllowed);
    }
    Push(Kind::kGlobal) = std::move(value);
  }

  // ('storage', type, key, location, number of elements[, view]) -> a storage.
  void PushStorage(size_t id) {
    const auto& parts = Expect(id, Kind::kTuple, "a storage's id").items;
    if (parts.size() < 5 || parts.size() > 6) Fail("a storage's id with {} parts, expected 5 or 6", parts.size());
    if (Text(parts[0], "a storage's id") != "storage") Fail("an external object that is not a storage");
    const PickleValue& type = Expect(parts[1], Kind::kGlobal, "a storage's type");
    if (type.global != PickleGlobal::kStorageType) Fail("a storage of type '{}'", type.text);
    if (parts.size() == 6) Expect(parts[5], Kind::kNone, "the view of a storage");
    PickleValue storage;
    const std::string& key = Text(parts[2], "a storage's key");
    if (key.size() > kMaxKeyLength) Fail("a storage's key of {} bytes, expected at most {}", key.size(), kMaxKeyLength);
    storage.kind = Kind::kStorage;
    storage.type = type.type;
    storage.text = key;
    storage.integer = Count(parts[4], "a storage's size");
    Push(Kind::kStorage) = std::move(storage);
  }

  void Reduce() {
    const auto call = PopItems(2);
    const PickleValue& global = Expect(call[0], Kind::kGlobal, "what is to be built");
    const auto& arguments = Expect(call[1], Kind::kTuple, "arguments").items;  // the arena's values never move
    switch (global.global) {
      case PickleGlobal::kOrderedDict:
        return BuildDict(arguments);
      case PickleGlobal::kRebuildTensor:
        return BuildTensor(arguments);
      case PickleGlobal::kRebuildParameter:
        if (arguments.empty()) Fail("a parameter without a tensor");
        Expect(arguments[0], Kind::kTensor, "a parameter");
        stack_.push_back(arguments[0]);
        return;
      case PickleGlobal::kStorageType:
        Fail("a call of '{}'", global.text);
    }
  }

  void BuildDict(const std::vector<size_t>& arguments) {
    std::vector<size_t> items;
    if (arguments.size() > 1) Fail("an ordered dict with {} arguments", arguments.size());
    if (!arguments.empty()) {
      for (const size_t entry : Expect(arguments[0], Kind::kList, "an ordered dict's entries").items) {
        const PickleValue& pair = values_[entry];
        if ((pair.kind != Kind::kList && pair.kind != Kind::kTuple) || pair.items.size() != 2) {
          Fail("an ordered dict's entry that is not a pair");
        }
        items.insert(items.end(), pair.items.begin(), pair.items.end());
      }
    }
    // Entries are copied here: without a budget, a short file could copy one long list over and over.
    num_copied_ += items.size();
    if (num_copied_ > bytes_.size()) Fail("more entries of ordered dicts than the file has bytes");
    Push(Kind::kDict).items = std::move(items);
  }

  // (storage, offset, sizes, strides, requires_grad, hooks[, metadata])
  void BuildTensor(const std::vector<size_t>& arguments) {
    if (arguments.size() < 4) Fail("a tensor described by {} values, expected at least 4", arguments.size());
    const PickleValue& storage = Expect(arguments[0], Kind::kStorage, "a tensor's storage");
    PickleValue tensor;
    tensor.kind = Kind::kTensor;
    tensor.items = {arguments[0]};
    tensor.integer = Count(arguments[1], "a tensor's offset");
    const auto& sizes = Expect(arguments[2], Kind::kTuple, "a tensor's sizes").items;
    const auto& strides = Expect(arguments[3], Kind::kTuple, "a tensor's strides").items;
    if (sizes.size() != strides.size() || sizes.size() > kMaxTensorAxes) {
      Fail("a tensor with {} sizes and {} strides", sizes.size(), strides.size());
    }
    for (const size_t size : sizes) tensor.sizes.push_back(Count(size, "a tensor's size"));
    for (const size_t stride : strides) tensor.strides.push_back(Count(stride, "a tensor's stride"));
    // 128-bit sums and an early stop: no product of hostile numbers can wrap around. Without elements nothing is
    // reached, but LibTorch multiplies the other sizes all the same.
    __extension__ typedef unsigned __int128 Wide;
    const auto limit = static_cast<Wide>(storage.integer);
    Wide num_elements = 1, last = static_cast<Wide>(tensor.integer);
    bool empty = false, beyond = false;
    for (const int64_t size : tensor.sizes) empty = empty || size == 0;
    for (size_t axis = 0; axis < tensor.sizes.size() && !beyond; ++axis) {
      if (tensor.sizes[axis] == 0) continue;
      num_elements *= static_cast<Wide>(tensor.sizes[axis]);
      last += static_cast<Wide>(tensor.sizes[axis] - 1) * static_cast<Wide>(tensor.strides[axis]);
      beyond = empty ? num_elements > INT64_MAX : num_elements > limit || last >= limit;
    }
    if (tensor.sizes.empty()) beyond = last >= limit;
    if (beyond) Fail("a tensor that reaches beyond its storage of {} elements", storage.integer);
    if (empty && tensor.integer > storage.integer) Fail("a tensor that begins beyond its storage");
    Push(Kind::kTensor) = std::move(tensor);
  }

  size_t Top() const {
    if (stack_.size() <= (marks_.empty() ? 0 : marks_.back())) Fail("the stack is empty");
    return stack_.back();
  }

  size_t Pop() {
    const size_t top = Top();
    stack_.pop_back();
    return top;
  }

  std::vector<size_t> PopItems(size_t count) {
    std::vector<size_t> items(count);
    for (size_t i = count; i > 0; --i) items[i - 1] = Pop();
    return items;
  }

  std::vector<size_t> PopToMark() {
    if (marks_.empty()) Fail("no mark on the stack");
    const auto begin = stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back());
    std::vector<size_t> items(begin, stack_.end());
    stack_.erase(begin, stack_.end());
    marks_.pop_back();
    return items;
  }

  void Extend(Kind kind, const std::vector<size_t>& items) {
    if (kind == Kind::kDict && items.size() % 2 != 0) Fail("a dict with a key but no value");
    Expect(Top(), kind, "what gets entries");
    auto& target = values_[Top()].items;
    target.insert(target.end(), items.begin(), items.end());
  }

  void Recall(uint64_t slot) {
    const auto found = memo_.find(slot);
    if (found == memo_.end()) Fail("memo {} was never written", slot);
    stack_.push_back(found->second);
  }

  const PickleValue& Expect(size_t index, Kind kind, const char* what) const {
    if (values_[index].kind != kind)
      Fail("{}: found {}, expected {}", what, KindName(values_[index].kind), KindName(kind));
    return values_[index];
  }
  const std::string& Text(size_t index, const char* what) const { return Expect(index, Kind::kString, what).text; }
  int64_t Count(size_t index, const char* what) const {
    const int64_t count = Expect(index, Kind::kInt, what).integer;
    if (count < 0) Fail("{}: found {}, expected at least 0", what, count);
    return count;
  }

  std::string_view bytes_;
  const std::string& name_;
  size_t cursor_ = 0;
  size_t num_copied_ = 0;
  std::deque<PickleValue> values_;
  std::vector<size_t> stack_, marks_;
  std::unordered_map<uint64_t, size_t> memo_;
};

}  // namespace

const char* KindName(Kind kind) {
  switch (kind) {
    case Kind::kNone:
      return "None";
    case Kind::kBool:
      return "a truth value";
    case Kind::kInt:
      return "an integer";
    case Kind::kFloat:
      return "a number";
    case Kind::kString:
      return "a string";
    case Kind::kTuple:
      return "a tuple";
    case Kind::kList:
      return "a list";
    case Kind::kDict:
      return "a dict";
    case Kind::kGlobal:
      return "a type";
    case Kind::kStorage:
      return "a storage";
    case Kind::kTensor:
      return "a tensor";
  }
  return "nothing known";
}

Pickle ReadPickle(std::string_view bytes, const std::string& name) { return Machine(bytes, name).Run(); }

}  // namespace editnerf
