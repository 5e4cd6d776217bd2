#include "atmos_model/expression.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

double value(const std::string& text, double x = 3.0, double y = -2.0) {
  const double values[] = {x, y};
  return Expression(text, {"x", "y_1"}, {{"k", 0.5}}).evaluate(values);
}

std::string complaint(const std::string& text, const std::map<std::string, double>& constants = {}) {
  try {
    Expression(text, {"x"}, constants);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Expression, HasTheUsualPrecedence) {
  EXPECT_EQ(value("2 + 3 * 4 - 10 / 5"), 12.0);
  EXPECT_EQ(value("(2 + 3) * 4"), 20.0);
  EXPECT_EQ(value("10 - 4 - 3"), 3.0);
  EXPECT_EQ(value("16 / 4 / 2"), 2.0);
  EXPECT_EQ(value("2 ^ 3 ^ 2"), 512.0);
  EXPECT_EQ(value("-2 ^ 2"), -4.0);
  EXPECT_EQ(value("2 ^ -1"), 0.5);
  EXPECT_EQ(value("2 * -x"), -6.0);
  EXPECT_EQ(value("--x + +x"), 6.0);
  EXPECT_EQ(value("1.5e1 + .5"), 15.5);
}

TEST(Expression, KnowsVariablesConstantsAndFunctions) {
  EXPECT_EQ(value("x * y_1 + k"), -5.5);
  EXPECT_DOUBLE_EQ(value("sin(x) + cos(x) + tanh(x)"), std::sin(3.0) + std::cos(3.0) + std::tanh(3.0));
  EXPECT_DOUBLE_EQ(value("exp(y_1) * sqrt(x) + abs(y_1)"), std::exp(-2.0) * std::sqrt(3.0) + 2.0);
  EXPECT_EQ(Expression().evaluate<double>(nullptr), 0.0);
}

TEST(Expression, LeavesOutWhatIsMultipliedByZero) {
  EXPECT_EQ(value("x + 0 * (1 / 0) - y_1"), 5.0);
  EXPECT_EQ(value("(1 / 0) * 0 - x"), -3.0);
  EXPECT_EQ(value("0 * x * y_1 + 0"), 0.0);
  EXPECT_EQ(value("0 * x - 2 * x ^ 2"), -18.0);
  EXPECT_EQ(value("2 ^ (0 * x)"), 1.0);
  EXPECT_EQ(value("-(0 * x) + 4 / (x + 0)"), 4.0 / 3.0);
}

TEST(Expression, SaysWhereItFails) {
  EXPECT_NE(complaint("1 + ").find("position 5"), std::string::npos) << complaint("1 + ");
  EXPECT_NE(complaint("speed").find("\"speed\""), std::string::npos);
  for (const char* bad :
       {"", "(", "1 2", "2x", "sin x", "sin()", "x)", "1 +* 2", "x $ 2", "1e999", ".", "x ^"})
    EXPECT_NE(complaint(bad), "") << bad;
  EXPECT_NE(complaint(std::string(10000, '(')), "");
  std::string deep = "x";
  for (int i = 0; i < 40; ++i) deep = "x + (" + deep + ")";
  EXPECT_NE(complaint(deep), "");
  std::string powers = "x";
  for (int i = 0; i < 10000; ++i) powers += "^x";
  EXPECT_NE(complaint(powers), "");
}

TEST(Expression, AConstantHidesNothing) {
  EXPECT_EQ(complaint("k", {{"k", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"x", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"sin", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"a b", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"", 1.0}}), "");
}

}  // namespace
}  // namespace atmos
