// Plain CDR as PX4 puts its messages on the line: little-endian, every field aligned to its own size from the
// first byte of the payload, no encapsulation header, no padding at the end. A message type lists its fields
// once, in visit(); these archives write, read, measure and describe it. Reading never goes beyond the end.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "atmos_px4_bridge/xrce/framing.h"

namespace atmos::xrce {

template <class Archive, class T, std::size_t N>
void visit_elements(Archive& archive, std::array<T, N>& elements) {
  for (T& element : elements) archive.element(element);
}

class CdrWriter {
 public:
  template <class T>
  void operator()(const char*, T& value) {
    element(value);
  }
  template <class T, std::size_t N>
  void operator()(const char*, std::array<T, N>& value) {
    visit_elements(*this, value);
  }
  template <class T>
  void element(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes.resize((bytes.size() + sizeof(T) - 1) / sizeof(T) * sizeof(T), 0);
    const std::size_t at = bytes.size();
    bytes.resize(at + sizeof(T));
    std::memcpy(bytes.data() + at, &value, sizeof(T));  // our machines are little-endian, too
  }
  Bytes bytes;
};

class CdrReader {
 public:
  explicit CdrReader(ByteView payload) : payload_(payload) {}
  template <class T>
  void operator()(const char*, T& value) {
    element(value);
  }
  template <class T, std::size_t N>
  void operator()(const char*, std::array<T, N>& value) {
    visit_elements(*this, value);
  }
  template <class T>
  void element(T& value) {
    static_assert(std::is_arithmetic_v<T>);
    at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (at_ + sizeof(T) > payload_.size) {
      short_ = true;
      return;
    }
    if constexpr (std::is_same_v<T, bool>) {
      value = payload_.data[at_] != 0;
    } else {
      std::memcpy(&value, payload_.data + at_, sizeof(T));
    }
    at_ += sizeof(T);
  }
  // All fields were there, and nothing else.
  bool complete() const { return !short_ && at_ == payload_.size; }

 private:
  ByteView payload_;
  std::size_t at_ = 0;
  bool short_ = false;
};

// Names, types and offsets of the fields, as the firmware's own message definition states them.
class CdrLayout {
 public:
  struct Field {
    std::string name, type;
    std::size_t offset;
  };
  template <class T>
  void operator()(const char* name, T&) {
    add<T>(name, name_of_type<T>(), 1);
  }
  template <class T, std::size_t N>
  void operator()(const char* name, std::array<T, N>&) {
    add<T>(name, name_of_type<T>() + "[" + std::to_string(N) + "]", N);
  }
  const std::vector<Field>& fields() const { return fields_; }
  std::size_t size() const { return size_; }
  // What PX4 answers to a MessageFormatRequest: 32-bit FNV-1a over the lines "type name".
  std::uint32_t hash() const {
    std::uint32_t hash = 2166136261u;
    for (const Field& field : fields_) {
      for (const char c : field.type + " " + field.name + "\n")
        hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
    }
    return hash;
  }

 private:
  template <class T>
  static std::string name_of_type() {
    if constexpr (std::is_same_v<T, bool>) return "bool";
    const std::string bits = std::to_string(8 * sizeof(T));
    if constexpr (std::is_floating_point_v<T>) return "float" + bits;
    return (std::is_signed_v<T> ? "int" : "uint") + bits;
  }
  template <class T>
  void add(const char* name, const std::string& type, std::size_t count) {
    const std::size_t offset = (size_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    fields_.push_back({name, type, offset});
    size_ = offset + count * sizeof(T);
  }
  std::vector<Field> fields_;
  std::size_t size_ = 0;
};

}  // namespace atmos::xrce
