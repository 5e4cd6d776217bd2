// Settings of a terminal device. A file of its own: the kernel's header for free baud rates and the C
// library's terminal header exclude each other.
#pragma once

namespace atmos {

// 8N1 at any rate, no flow control, bytes as they are. False with errno set.
bool set_raw(int fd, int baud);
// Throws away what has come and was not read.
void discard_input(int fd);

}  // namespace atmos
