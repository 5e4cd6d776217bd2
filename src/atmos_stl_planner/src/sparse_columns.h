// A model by columns, as the C interfaces of CBC and CLP take it.
#pragma once

#include <coin/CoinTypes.hpp>
#include <vector>

#include "atmos_stl_planner/milp.h"

namespace atmos::stl {

struct SparseColumns {
  static constexpr double kInfinite = 1e30;

  std::vector<CoinBigIndex> starts;
  std::vector<int> rows;
  std::vector<double> values, column_lower, column_upper, cost, row_lower, row_upper;

  explicit SparseColumns(const MilpModel& model) {
    std::vector<std::vector<std::pair<int, double>>> columns(model.columns.size());
    for (std::size_t i = 0; i < model.rows.size(); ++i) {
      for (const auto& [column, value] : model.rows[i].terms)
        columns[static_cast<std::size_t>(column)].emplace_back(static_cast<int>(i), value);
      row_lower.push_back(limited(model.rows[i].lower));
      row_upper.push_back(limited(model.rows[i].upper));
    }
    for (std::size_t j = 0; j < columns.size(); ++j) {
      starts.push_back(static_cast<CoinBigIndex>(rows.size()));
      for (const auto& [row, value] : columns[j]) {
        rows.push_back(row);
        values.push_back(value);
      }
      column_lower.push_back(limited(model.columns[j].lower));
      column_upper.push_back(limited(model.columns[j].upper));
      cost.push_back(model.columns[j].cost);
    }
    starts.push_back(static_cast<CoinBigIndex>(rows.size()));
  }

 private:
  static double limited(double bound) {
    return bound > kInfinite ? kInfinite : bound < -kInfinite ? -kInfinite : bound;
  }
};

}  // namespace atmos::stl
