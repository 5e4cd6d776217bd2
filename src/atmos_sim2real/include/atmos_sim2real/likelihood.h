// Likelihood of flights under a plant, and the noise level that fits best.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "atmos_sim2real/flight.h"

namespace atmos {

// Whitened innovations of one flight: all of x, then y, then yaw; burn-in frames are 0.
Eigen::VectorXd innovations(const Flight& flight, const ForceIntegrals& forces, const NoiseModel& noise,
                            double* log_determinant = nullptr);

// -1/2 (sum of squares + log determinant); constants left out.
double log_likelihood(const Eigen::VectorXd& innovations, double log_determinant);

// Finds the noise under which the flights are most likely, given the forces, by coordinate search over slow
// acceleration, scatter, distortion and white noise, from `start`, which stays where 0.3 nats or less can be
// gained. Levels stay above physical floors, and distortions of a millimetre cost nats. Without `thorough`
// the start must be near.
NoiseModel fit_noise(const std::vector<Flight>& flights, const std::vector<ForceIntegrals>& forces,
                     NoiseModel start, bool thorough);

// White noise of the frames out of third differences, robustly.
NoiseModel initial_noise(const std::vector<Flight>& flights);

// Calls work(i) for i in [0, count) on the machine's cores; called from within such work, on the same core.
// Rethrows what one of them throws.
void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work);

}  // namespace atmos
