// The emulator's end of a serial line: a pseudo-terminal under a path of its own, which can be unplugged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace atmos {

class PseudoTerminal {
 public:
  // `path`: where the device shall appear (a symbolic link). Throws std::runtime_error when it cannot.
  explicit PseudoTerminal(std::string path);
  ~PseudoTerminal();
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  // As if the cable was pulled: the device disappears under whoever has it open. And back.
  void unplug();
  void plug();
  bool plugged() const { return master_ >= 0; }

  std::size_t read(std::uint8_t* buffer, std::size_t size);
  // What the line does not take is lost, as on a wire that nobody reads.
  void write(const std::uint8_t* data, std::size_t size);

 private:
  std::string path_;
  int master_ = -1, slave_ = -1;
};

}  // namespace atmos
