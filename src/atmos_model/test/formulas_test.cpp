#include "atmos_model/formulas.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

double value(const std::string& text, double x = 3.0, double y = -2.0) {
  const double values[] = {x, y};
  double result;
  Formulas({text}, {"x", "y_1"}, {{"k", 0.5}}).evaluate(values, &result);
  return result;
}

std::string complaint(const std::string& text, const std::map<std::string, double>& constants = {}) {
  try {
    Formulas({text}, {"x"}, constants);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Formulas, HasTheUsualPrecedence) {
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

TEST(Formulas, KnowsVariablesConstantsAndFunctions) {
  EXPECT_EQ(value("x * y_1 + k"), -5.5);
  EXPECT_DOUBLE_EQ(value("sin(x) + cos(x) + tanh(x)"), std::sin(3.0) + std::cos(3.0) + std::tanh(3.0));
  EXPECT_DOUBLE_EQ(value("exp(y_1) * sqrt(x) + abs(y_1)"), std::exp(-2.0) * std::sqrt(3.0) + 2.0);
}

TEST(Formulas, LeavesOutWhatIsMultipliedByZero) {
  EXPECT_EQ(value("x + 0 * (1 / 0) - y_1"), 5.0);
  EXPECT_EQ(value("(1 / 0) * 0 - x"), -3.0);
  EXPECT_EQ(value("0 * x * y_1 + 0"), 0.0);
  EXPECT_EQ(value("0 * x - 2 * x ^ 2"), -18.0);
  EXPECT_EQ(value("2 ^ (0 * x)"), 1.0);
  EXPECT_EQ(value("-(0 * x) + 4 / (x + 0)"), 4.0 / 3.0);
}

TEST(Formulas, AreCompiledTogether) {
  std::string sum = "x", product = "1";
  for (int i = 1; i < 400; ++i) {
    sum += " + x / " + std::to_string(i);
    product += " * (x / " + std::to_string(i) + ")";
  }
  const double x = 3.0;
  double expected_sum = x, expected_product = 1.0;
  for (int i = 1; i < 400; ++i) {
    expected_sum += x / i;
    expected_product *= x / i;
  }
  double results[3];
  Formulas({sum, "cos(x) - cos(x) ^ 2", product}, {"x"}, {}).evaluate(&x, results);
  EXPECT_EQ(results[0], expected_sum);
  EXPECT_EQ(results[1], std::cos(x) - std::cos(x) * std::cos(x));
  EXPECT_EQ(results[2], expected_product);
}

TEST(Formulas, SaysWhereItFails) {
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

TEST(Formulas, AConstantHidesNothing) {
  EXPECT_EQ(complaint("k", {{"k", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"x", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"sin", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"a b", 1.0}}), "");
  EXPECT_NE(complaint("x", {{"", 1.0}}), "");
}

}  // namespace
}  // namespace atmos
