#include "atmos_stl_planner/milp.h"

#include <algorithm>
#include <cmath>

namespace atmos::stl {

LinearExpression& LinearExpression::add(const LinearExpression& other, double factor) {
  for (const auto& [column, coefficient] : other.terms) terms.emplace_back(column, factor * coefficient);
  constant += factor * other.constant;
  return *this;
}

int MilpModel::add_column(double lower, double upper, double cost, bool integer) {
  columns.push_back({lower, upper, cost, integer});
  return static_cast<int>(columns.size()) - 1;
}

void MilpModel::add_row(double lower, const LinearExpression& expression, double upper) {
  Row row{lower - expression.constant, upper - expression.constant, expression.terms};
  std::sort(row.terms.begin(), row.terms.end());
  std::size_t kept = 0;
  for (const auto& term : row.terms) {
    if (kept > 0 && row.terms[kept - 1].first == term.first) {
      row.terms[kept - 1].second += term.second;
    } else {
      row.terms[kept++] = term;
    }
  }
  row.terms.resize(kept);
  rows.push_back(std::move(row));
}

MilpModel with_integers_fixed(const MilpModel& model, const std::vector<double>& x) {
  MilpModel fixed = model;
  for (std::size_t j = 0; j < std::min(x.size(), fixed.columns.size()); ++j) {
    MilpModel::Column& column = fixed.columns[j];
    if (!column.integer) continue;
    column.lower = column.upper = std::round(x[j]);
    column.integer = false;
  }
  return fixed;
}

}  // namespace atmos::stl
