// For tests: fields of any message as text, and random messages. The bits of a field as an unsigned integer,
// elements of arrays joined by commas.
#pragma once

#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <type_traits>

#include "atmos_px4_bridge/mavlink/codec.h"

namespace atmos::mavlink::test {

template <class T, class = void>
struct IsArray : std::false_type {};
template <class T>
struct IsArray<T, std::void_t<typename T::value_type>> : std::true_type {};

template <class T>
std::uint64_t bits_of(const T& scalar) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &scalar, sizeof(scalar));
  return bits;
}

// Calls visit(element) for each element of an array, or for the scalar itself.
template <class Field, class Visit>
void for_each_element(Field& field, Visit&& visit) {
  if constexpr (IsArray<std::remove_const_t<Field>>::value) {
    for (auto& element : field) visit(element);
  } else {
    visit(field);
  }
}

template <class Message>
std::string text_of(const Message& message) {
  std::string text;
  const auto add = [&text](const char* name, const auto& field) {
    text += std::string(" ") + name + "=";
    for_each_element(field, [&text](const auto& e) { text += std::to_string(bits_of(e)) + ","; });
    text.pop_back();
  };
  Message::visit_base(message, add);
  Message::visit_extension(message, add);
  return text;
}

// Every bit random, except that texts have no zero in between and floats are no NaN.
template <class Message, class Random>
Message random_message(Random& random) {
  Message message;
  const auto fill = [&random](const char*, auto& field) {
    const bool zero = random() % 4 == 0;
    for_each_element(field, [&](auto& element) {
      using T = std::remove_reference_t<decltype(element)>;
      if (zero) {
        element = T{};
      } else if constexpr (std::is_same_v<T, float>) {
        element = static_cast<float>(static_cast<double>(random() % 2000001) / 1000.0 - 1000.0);
      } else if constexpr (std::is_same_v<T, char>) {
        element = static_cast<char>('a' + random() % 26);
      } else {
        element = static_cast<T>(random());
      }
    });
  };
  Message::visit_base(message, fill);
  Message::visit_extension(message, fill);
  return message;
}

inline std::string hex(const u8* data, std::size_t size) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (std::size_t i = 0; i < size; ++i) {
    text += kDigits[data[i] >> 4];
    text += kDigits[data[i] & 15];
  }
  return text;
}

}  // namespace atmos::mavlink::test
