// Ipopt's CPU clocks, replaced. Ipopt 3.11 reads them at the start and at the end of every one of its tasks,
// by two system calls each, whether the times are wanted or not: some 220 a solve, a third of a solve's time
// where system calls are dear. The dynamic linker takes the first definition in its order, and this library
// stands before the one it needs. A later Ipopt (3.14) that reads them on request only does not mind.
//
// What is lost: Ipopt's max_cpu_time counts wall time, as our own time limit does.
#include <IpUtils.hpp>

namespace Ipopt {

Number CpuTime() { return WallclockTime(); }
Number SysTime() { return 0.0; }

}  // namespace Ipopt
