#include "atmos_sim2real/crossvalidation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <random>

namespace atmos {

namespace {

struct Block {
  std::size_t flight;
  Eigen::Index first, count;  // frames
};

std::vector<Block> blocks_of(const std::vector<Flight>& flights, double length_s) {
  std::vector<Block> blocks;
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const std::vector<double>& times = flights[f].times();
    std::size_t first = 0;
    for (std::size_t i = 1; i <= times.size(); ++i) {
      if (i == times.size() || times[i] - times[first] >= length_s) {
        blocks.push_back({f, static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(i - first)});
        first = i;
      }
    }
  }
  return blocks;
}

// Rows of one block: the same frames of all three axes.
Eigen::VectorXd rows(const Eigen::VectorXd& all, const Block& block) {
  const Eigen::Index frames = all.size() / kAxes;
  Eigen::VectorXd out(kAxes * block.count);
  for (int axis = 0; axis < kAxes; ++axis)
    out.segment(axis * block.count, block.count) = all.segment(axis * frames + block.first, block.count);
  return out;
}

Eigen::MatrixXd rows(const Eigen::MatrixXd& all, const Block& block) {
  const Eigen::Index frames = all.rows() / kAxes;
  Eigen::MatrixXd out(kAxes * block.count, all.cols());
  for (int axis = 0; axis < kAxes; ++axis)
    out.middleRows(axis * block.count, block.count) =
        all.middleRows(axis * frames + block.first, block.count);
  return out;
}

// Sum of the log standard deviations of each block's innovations.
std::vector<double> log_deviations(const std::vector<Flight>& flights, const NoiseModel& noise,
                                   const std::vector<Block>& blocks) {
  std::vector<double> sums(blocks.size(), 0.0);
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const auto whiteners = flights[f].whiteners(noise);
    for (const Whitener& whitener : *whiteners) {
      for (std::size_t k = 0; k < blocks.size(); ++k) {
        if (blocks[k].flight != f) continue;
        for (Eigen::Index i = blocks[k].first; i < blocks[k].first + blocks[k].count; ++i)
          sums[k] += whitener.log_deviation(static_cast<std::size_t>(i));
      }
    }
  }
  return sums;
}

double half_log_determinant(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return factor.matrixLLT().diagonal().array().log().sum();
}

// Negative log likelihood of every block when the parameters are known from the others alone, as well as
// those determine them: what a map says of a place that no other block visits is little, and is not held
// against it.
std::vector<double> left_out_loss(const Problem& problem, const Fit& fit, const std::vector<Block>& blocks) {
  const auto n = static_cast<Eigen::Index>(fit.free.size());
  std::vector<double> loss = log_deviations(*problem.flights, fit.noise, blocks);
  if (n == 0) {
    for (std::size_t k = 0; k < blocks.size(); ++k)
      loss[k] += 0.5 * rows(fit.innovations[blocks[k].flight], blocks[k]).squaredNorm();
    return loss;
  }
  const std::shared_ptr<const Linearisation> linearisation = linearisation_of(problem, fit);
  const std::vector<Eigen::MatrixXd>& J = linearisation->columns;
  const Eigen::MatrixXd H = prior_precision(fit.free) + linearisation->information;
  const Eigen::LLT<Eigen::MatrixXd> all(H);
  in_parallel(blocks.size(), [&](std::size_t k) {
    const Eigen::MatrixXd j = rows(J[blocks[k].flight], blocks[k]);
    const Eigen::VectorXd e = rows(fit.innovations[blocks[k].flight], blocks[k]);
    Eigen::MatrixXd rest = H;
    rest.selfadjointView<Eigen::Lower>().rankUpdate(j.transpose(), -1.0);
    const Eigen::LLT<Eigen::MatrixXd> others(rest);
    const Eigen::VectorXd left = e + j * others.solve(j.transpose() * e);
    // Of N(0, I + j P j') with P the inverse of what the others know, by the matrix inversion lemma.
    const Eigen::VectorXd v = j.transpose() * left;
    loss[k] += 0.5 * (left.squaredNorm() - v.dot(all.solve(v))) + half_log_determinant(all) -
               half_log_determinant(others);
  });
  return loss;
}

bool is_of_its_block(const Effect& effect) {
  return std::holds_alternative<ExternalImpulse>(effect) || std::holds_alternative<FrictionPatch>(effect) ||
         std::holds_alternative<FloorVibration>(effect);
}

}  // namespace

BlockEvidence block_evidence(const Problem& problem, Fit base, Fit fitted, std::size_t judged,
                             std::uint32_t seed) {
  base.hold([&](const FreeParameter& free) { return is_of_its_block(base.effects[free.effect]); });
  fitted.hold([&](const FreeParameter& free) {
    return free.effect != judged && is_of_its_block(fitted.effects[free.effect]);
  });
  const bool several = problem.flights->size() > 1;
  constexpr double kBlock = 10.0, kWhole = 1e9;  // s
  const auto gains = [&](const std::vector<Block>& over) {
    const std::vector<double> without = left_out_loss(problem, base, over);
    const std::vector<double> with = left_out_loss(problem, fitted, over);
    std::vector<double> gain(over.size());
    for (std::size_t k = 0; k < over.size(); ++k) gain[k] = without[k] - with[k];
    return gain;
  };
  BlockEvidence evidence;
  evidence.block_gain = gains(blocks_of(*problem.flights, kBlock));
  for (const double gain : several ? gains(blocks_of(*problem.flights, kWhole)) : evidence.block_gain)
    evidence.heldout_gain += gain;
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> draw(0, evidence.block_gain.size() - 1);
  constexpr int kResamples = 200;
  int wins = 0;
  for (int r = 0; r < kResamples; ++r) {
    double sum = 0.0;
    for (std::size_t k = 0; k < evidence.block_gain.size(); ++k) sum += evidence.block_gain[draw(random)];
    wins += sum > 0.0;
  }
  evidence.inclusion = static_cast<double>(wins) / kResamples;
  return evidence;
}

}  // namespace atmos
