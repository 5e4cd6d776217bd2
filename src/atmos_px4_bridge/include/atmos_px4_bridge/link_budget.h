// What a flight puts on a serial line, computed from the tables of messages.
#pragma once

#include <string>
#include <vector>

#include "atmos_px4_bridge/xrce/px4_messages.h"

namespace atmos {

struct BudgetRow {
  std::string message;
  bool to_autopilot;
  double bytes;  // of a whole frame; MAVLink: nothing truncated, XRCE: nothing stuffed
  double rate_hz;
};

// Both directions in flight, at the rates that link and autopilot keep.
std::vector<BudgetRow> mavlink_traffic();
// The same over XRCE, set-points of the thruster level; from the autopilot: what PX4Space publishes at its
// limit of 100 Hz. Its other topics add a few kB/s.
std::vector<BudgetRow> xrce_traffic(xrce::Firmware firmware);

// Bytes per second of the rows of one direction, and their share of a line of `baud`, 10 bits a byte.
double line_load(const std::vector<BudgetRow>& rows, bool to_autopilot);
double line_share(const std::vector<BudgetRow>& rows, bool to_autopilot, double baud);

}  // namespace atmos
