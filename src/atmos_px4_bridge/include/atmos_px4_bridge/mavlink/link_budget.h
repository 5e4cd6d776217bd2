// What a flight puts on a serial line, computed from the message table.
#pragma once

#include <vector>

namespace atmos {

struct BudgetRow {
  const char* message;
  bool to_autopilot;
  double bytes;  // of a whole frame, nothing truncated
  double rate_hz;
};

// Both directions in flight, at the rates that link and autopilot keep.
std::vector<BudgetRow> flight_traffic();

// Share of a line of `baud`, 10 bits a byte, that the rows of one direction take.
double line_share(const std::vector<BudgetRow>& rows, bool to_autopilot, double baud);

}  // namespace atmos
