// The MAVLink messages we speak, as plain structs made of the rows of messages.def. Field names, units and
// frames are those of the public message definitions; conversions are in ../frames.h and nowhere else.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace atmos::mavlink {

using u8 = std::uint8_t;
using i8 = std::int8_t;
using u16 = std::uint16_t;
using i16 = std::int16_t;
using u32 = std::uint32_t;
using i32 = std::int32_t;
using u64 = std::uint64_t;
using i64 = std::int64_t;
using f32 = float;
template <std::size_t N>
using Floats = std::array<float, N>;
template <std::size_t N>
using Words = std::array<u16, N>;
template <std::size_t N>
using Bytes = std::array<u8, N>;

// A text of at most N characters, zero-terminated only where it is shorter.
template <std::size_t N>
struct Text : std::array<char, N> {
  Text() : std::array<char, N>{} {}
  Text(const std::string& text) : Text() {
    std::copy_n(text.begin(), std::min(N, text.size()), this->begin());
  }
  std::string str() const { return {this->begin(), std::find(this->begin(), this->end(), '\0')}; }
};

// A row's fields are a sequence (type, name)(type, name)...: two macros take turns in walking along it.
#define ATMOS_JOIN_(a, b) a##b
#define ATMOS_JOIN(a, b) ATMOS_JOIN_(a, b)
#define ATMOS_MEMBER_A(type, name) \
  type name{};                     \
  ATMOS_MEMBER_B
#define ATMOS_MEMBER_B(type, name) \
  type name{};                     \
  ATMOS_MEMBER_A
#define ATMOS_MEMBER_A_END
#define ATMOS_MEMBER_B_END
#define ATMOS_VISIT_A(type, name) \
  visit(#name, message.name);     \
  ATMOS_VISIT_B
#define ATMOS_VISIT_B(type, name) \
  visit(#name, message.name);     \
  ATMOS_VISIT_A
#define ATMOS_VISIT_A_END
#define ATMOS_VISIT_B_END
#define ATMOS_SIZE_A(type, name) +sizeof(type) ATMOS_SIZE_B
#define ATMOS_SIZE_B(type, name) +sizeof(type) ATMOS_SIZE_A
#define ATMOS_SIZE_A_END
#define ATMOS_SIZE_B_END

// visit_base and visit_extension call visit(name, field) for every field in wire order.
#define ROW(Type, id, crc_extra, base, extension)                                                    \
  struct Type {                                                                                      \
    static constexpr u32 kId = id;                                                                   \
    static constexpr u8 kCrcExtra = crc_extra;                                                       \
    static constexpr const char* kName = #Type;                                                      \
    static constexpr std::size_t kBaseSize = 0 ATMOS_JOIN(ATMOS_SIZE_A base, _END);                  \
    static constexpr std::size_t kSize = kBaseSize ATMOS_JOIN(ATMOS_SIZE_A extension, _END);         \
    ATMOS_JOIN(ATMOS_MEMBER_A base, _END)                                                            \
    ATMOS_JOIN(ATMOS_MEMBER_A extension, _END)                                                       \
    template <class Message, class Visit>                                                            \
    static void visit_base(Message& message, Visit&& visit) {                                        \
      ATMOS_JOIN(ATMOS_VISIT_A base, _END)                                                           \
    }                                                                                                \
    template <class Message, class Visit>                                                            \
    static void visit_extension([[maybe_unused]] Message& message, [[maybe_unused]] Visit&& visit) { \
      ATMOS_JOIN(ATMOS_VISIT_A extension, _END)                                                      \
    }                                                                                                \
  };
#include "atmos_px4_bridge/mavlink/messages.def"
#undef ROW

// What framing needs to know of a message.
struct MessageInfo {
  u32 id;
  u8 crc_extra;
  u8 base_size;  // without extensions: the length in version 1
  u8 size;
  const char* name;
};

inline constexpr MessageInfo kMessages[] = {
#define ROW(Type, id, crc_extra, base, extension) {id, crc_extra, Type::kBaseSize, Type::kSize, #Type},
#include "atmos_px4_bridge/mavlink/messages.def"
#undef ROW
};

// Calls visit(Message{}) once for every message of the table.
template <class Visit>
void for_each_message(Visit&& visit) {
#define ROW(Type, id, crc_extra, base, extension) visit(Type{});
#include "atmos_px4_bridge/mavlink/messages.def"
#undef ROW
}

}  // namespace atmos::mavlink
