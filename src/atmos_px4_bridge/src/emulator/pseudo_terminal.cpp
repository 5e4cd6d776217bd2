#include "atmos_px4_bridge/emulator/pseudo_terminal.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "../serial_line.h"

namespace atmos {

PseudoTerminal::PseudoTerminal(std::string path) : path_(std::move(path)) {
  struct stat status {};
  if (::lstat(path_.c_str(), &status) == 0 && !S_ISLNK(status.st_mode))
    throw std::runtime_error(path_ + ": exists and is no symbolic link");
  plug();
}

PseudoTerminal::~PseudoTerminal() { unplug(); }

void PseudoTerminal::plug() {
  if (plugged()) return;
  const auto fail = [this] { throw std::runtime_error(path_ + ": " + std::strerror(errno)); };
  master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0) fail();
  char name[128];
  if (::ptsname_r(master_, name, sizeof(name)) != 0) fail();
  // Held open: otherwise reads would fail while nobody else has the device.
  slave_ = ::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  constexpr int kAnyBaud = 115200;  // a pseudo-terminal has no speed
  if (slave_ < 0 || !set_raw(slave_, kAnyBaud)) fail();
  ::unlink(path_.c_str());
  if (::symlink(name, path_.c_str()) != 0) fail();
}

void PseudoTerminal::unplug() {
  if (!plugged()) return;
  ::unlink(path_.c_str());
  ::close(slave_);
  ::close(master_);
  master_ = slave_ = -1;
}

std::size_t PseudoTerminal::read(std::uint8_t* buffer, std::size_t size) {
  if (!plugged()) return 0;
  const ssize_t got = ::read(master_, buffer, size);
  return got > 0 ? static_cast<std::size_t>(got) : 0;
}

void PseudoTerminal::write(const std::uint8_t* data, std::size_t size) {
  if (plugged() && ::write(master_, data, size) < 0 && errno == EIO) unplug();
}

}  // namespace atmos
