#include "serial_line.h"

#include <asm/termbits.h>
#include <sys/ioctl.h>

namespace atmos {

bool set_raw(int fd, int baud) {
  termios2 settings{};
  if (::ioctl(fd, TCGETS2, &settings) != 0) return false;
  settings.c_iflag = 0;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER;
  settings.c_ispeed = settings.c_ospeed = static_cast<speed_t>(baud);
  // Reads return at once, with EAGAIN when there is nothing.
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  return ::ioctl(fd, TCSETS2, &settings) == 0;
}

void discard_input(int fd) { ::ioctl(fd, TCFLSH, TCIFLUSH); }

}  // namespace atmos
