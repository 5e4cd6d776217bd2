#include "atmos_sim2real/locate.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "atmos_sim2real/statement.h"

namespace atmos {

namespace {

using Columns = Eigen::Matrix<double, Eigen::Dynamic, FrameGains::kColumns>;

// Innovations of one flight by axis, and turned into the body.
Columns by_column(const Flight& flight, const Eigen::VectorXd& innovations) {
  const Eigen::Index n = innovations.size() / kAxes;
  Columns columns(n, FrameGains::kColumns);
  for (int axis = 0; axis < kAxes; ++axis) columns.col(axis) = innovations.segment(axis * n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double yaw = flight.motion()[static_cast<std::size_t>(i)].yaw;
    columns(i, FrameGains::kForward) = std::cos(yaw) * columns(i, 0) + std::sin(yaw) * columns(i, 1);
    columns(i, FrameGains::kLeft) = std::cos(yaw) * columns(i, 1) - std::sin(yaw) * columns(i, 0);
  }
  return columns;
}

FrameGains squares_less(const Problem& problem, const Fit& before, const Fit& after) {
  FrameGains gains;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    gains.nats.push_back(0.5 * (by_column(flight, before.innovations[f]).array().square() -
                                by_column(flight, after.innovations[f]).array().square()));
  }
  return gains;
}

struct Share {
  double nats = 0.0, frames = 0.0;

  void add(const Share& other) {
    nats += other.nats;
    frames += other.frames;
  }
};

// The most concentrated answer to one question.
class Answer {
 public:
  Answer(std::string what, const Share& all) : place_{std::move(what), "", 0.0, 0.0}, all_(all) {}

  // `statement` tells it in words, where it is kept.
  template <class Statement>
  void offer(const Share& part, const Statement& statement) {
    const double share = std::clamp(part.nats / all_.nats, 0.0, 1.0), even = part.frames / all_.frames;
    constexpr double kLeast = 0.15, kDeviations = 3.0;
    // A gain of g nats is known to sqrt(2 g).
    const double deviation =
        std::sqrt(2.0 * (share * (1.0 - even) * (1.0 - even) + (1.0 - share) * even * even) / all_.nats);
    if (even <= 0.0 || even >= 1.0 || share - even < std::max(kLeast, kDeviations * deviation)) return;
    const double entropy = share * std::log(share / even) +
                           (share < 1.0 ? (1.0 - share) * std::log((1.0 - share) / (1.0 - even)) : 0.0);
    if (entropy <= entropy_) return;
    entropy_ = entropy;
    place_.statement = statement();
    place_.share = share;
    place_.even_share = even;
  }

  double entropy() const { return entropy_; }
  const Place& place() const { return place_; }

 private:
  Place place_;
  Share all_;
  double entropy_ = 0.0;
};

// One frame, with all that a regime may be made of.
struct Observed {
  std::size_t flight;
  Share share;
  double since_s;  // the first command
  double speed_m_s, turn_rate_rad_s, yaw_rad, gas_kg;
  Eigen::Vector2d p_m;
  std::vector<bool> fired;  // by thruster, within the last 0.3 s, in which a push shows

  long open() const { return std::count(fired.begin(), fired.end(), true); }
};

std::vector<Observed> observed_frames(const Problem& problem, const FrameGains& gains) {
  constexpr double kShows = 0.3;  // s
  std::vector<Observed> frames;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const Recording& recording = flight.recording();
    const auto& commands = recording.commands;
    std::vector<VecX<double>> hidden;
    flight.integrate(problem.plant({}, f), &hidden);
    const Eigen::VectorXd nats = gains.of_frames(f);
    std::size_t first = 0;  // command that still shows
    for (std::size_t i = 0; i < flight.frames(); ++i) {
      const double now = flight.times()[i];
      while (first + 1 < commands.size() && commands[first + 1].stamp_s <= now - kShows) ++first;
      std::vector<bool> fired(commands[first].duty.size(), false);
      for (std::size_t c = first; c < commands.size() && commands[c].stamp_s <= now; ++c) {
        for (std::size_t k = 0; k < fired.size(); ++k)
          fired[k] = fired[k] || std::abs(commands[c].duty[k]) > 0.02;
      }
      const PlanarState<double>& motion = flight.motion()[i];
      frames.push_back({f,
                        {nats[static_cast<Eigen::Index>(i)], 1.0},
                        now - recording.start_s(),
                        motion.v_WC.norm(),
                        std::abs(motion.yaw_rate),
                        wrap_angle(motion.yaw),
                        hidden[i][0],
                        motion.p_WC,
                        std::move(fired)});
    }
  }
  return frames;
}

template <class Inside>
Share share_where(const std::vector<Observed>& frames, const Inside& inside) {
  Share share;
  for (const Observed& frame : frames) {
    if (inside(frame)) share.add(frame.share);
  }
  return share;
}

// Seconds of the flights, one after the other, with what each gained.
struct Second {
  std::size_t flight;
  double begin_s = 0.0;  // since the first command
  double centre_nats = 0.0;
  Share share;

  double centre_s() const { return share.nats > 0.0 ? begin_s + centre_nats / share.nats : begin_s + 0.5; }
};

std::vector<Second> seconds_of(const std::vector<Observed>& frames) {
  std::vector<Second> seconds;
  for (const Observed& frame : frames) {
    const double begin = std::floor(frame.since_s);
    if (seconds.empty() || seconds.back().flight != frame.flight || seconds.back().begin_s != begin)
      seconds.push_back({frame.flight, begin, 0.0, {}});
    seconds.back().centre_nats += (frame.since_s - begin) * std::max(0.0, frame.share.nats);
    seconds.back().share.add(frame.share);
  }
  return seconds;
}

std::string seconds_text(double seconds) { return short_number(std::max(0.0, seconds)); }

// From one second to another of the same flight: an onset, an end, a stretch.
void offer_stretches(const std::vector<Second>& seconds, const std::vector<std::string>& names,
                     Answer& answer) {
  for (std::size_t a = 0; a < seconds.size(); ++a) {
    const bool starts = a == 0 || seconds[a - 1].flight != seconds[a].flight;
    Share share;
    for (std::size_t b = a; b < seconds.size() && seconds[b].flight == seconds[a].flight; ++b) {
      share.add(seconds[b].share);
      const bool ends = b + 1 == seconds.size() || seconds[b + 1].flight != seconds[b].flight;
      if (starts && ends) continue;  // that is the recording
      answer.offer(share, [&] {
        const std::string from = seconds_text(seconds[a].begin_s),
                          to = seconds_text(seconds[b].begin_s + 1.0);
        const std::string when = ends     ? "from " + from + " s after the first command on"
                                 : starts ? "until " + to + " s after the first command"
                                          : "from " + from + " to " + to + " s after the first command";
        return when + (names.size() > 1 ? " of " + names[seconds[a].flight] : "");
      });
    }
  }
}

// Neighbouring seconds of a flight, by their places in the list of all.
struct Moment {
  std::size_t first, last, strongest;
};

std::vector<Moment> moments_of(const std::vector<Second>& seconds, const std::vector<std::size_t>& chosen) {
  constexpr double kNeighbours = 2.0;  // s
  std::vector<Moment> moments;
  for (const std::size_t s : chosen) {
    const bool continues = !moments.empty() && seconds[s].flight == seconds[moments.back().last].flight &&
                           seconds[s].begin_s - seconds[moments.back().last].begin_s <= kNeighbours;
    if (!continues) {
      moments.push_back({s, s, s});
      continue;
    }
    moments.back().last = s;
    if (seconds[s].share.nats > seconds[moments.back().strongest].share.nats) moments.back().strongest = s;
  }
  return moments;
}

// A few moments, wherever they are: single events.
void offer_moments(const std::vector<Second>& seconds, const std::vector<std::string>& names, double all_nats,
                   Answer& answer) {
  constexpr std::size_t kMost = 6;
  constexpr double kLongest = 4.0;  // s
  constexpr double kLeast = 0.5;    // of all nats
  std::vector<std::size_t> order(seconds.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return seconds[a].share.nats > seconds[b].share.nats; });
  Share share;
  std::vector<std::size_t> chosen;
  for (const std::size_t next : order) {
    chosen.insert(std::lower_bound(chosen.begin(), chosen.end(), next), next);
    share.add(seconds[next].share);
    const std::vector<Moment> moments = moments_of(seconds, chosen);
    for (const Moment& moment : moments) {
      if (seconds[moment.last].begin_s - seconds[moment.first].begin_s >= kLongest) return;
    }
    if (moments.size() > kMost || share.nats < kLeast * all_nats) continue;
    answer.offer(share, [&] {
      std::string list;
      for (std::size_t m = 0; m < moments.size(); ++m) {
        const Second& second = seconds[moments[m].strongest];
        const bool last = m + 1 == moments.size();
        list += std::string(m == 0 ? ""
                            : last ? " and "
                                   : ", ") +
                seconds_text(second.centre_s()) + " s" +
                (names.size() > 1 ? " of " + names[second.flight] : "");
      }
      return "around " + list + " after the first command";
    });
  }
}

// Above or below one of the feature's quantiles.
template <class Feature, class Statement>
void offer_thresholds(const std::vector<Observed>& frames, const Feature& feature, const Statement& statement,
                      Answer& answer) {
  std::vector<double> sorted;
  for (const Observed& frame : frames) sorted.push_back(feature(frame));
  std::sort(sorted.begin(), sorted.end());
  for (const double quantile : {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}) {
    const double limit = sorted[static_cast<std::size_t>(quantile * static_cast<double>(sorted.size() - 1))];
    for (const bool above : {false, true}) {
      const Share share =
          share_where(frames, [&](const Observed& i) { return (feature(i) > limit) == above; });
      answer.offer(share, [&] { return statement(above, limit); });
    }
  }
}

// Rectangles of the visited floor.
void offer_places(const std::vector<Observed>& frames, const Box& floor, Answer& answer) {
  const double cell = std::max({0.5, (floor.x1 - floor.x0) / 12.0, (floor.y1 - floor.y0) / 12.0});  // m
  const auto columns = static_cast<std::size_t>((floor.x1 - floor.x0) / cell) + 1;
  const auto rows = static_cast<std::size_t>((floor.y1 - floor.y0) / cell) + 1;
  const auto index = [cell](double value, double origin, std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(std::max(0.0, (value - origin) / cell)));
  };
  std::vector<Share> cells(columns * rows);
  for (const Observed& i : frames)
    cells[index(i.p_m.y(), floor.y0, rows) * columns + index(i.p_m.x(), floor.x0, columns)].add(i.share);
  for (std::size_t left = 0; left < columns; ++left) {
    for (std::size_t bottom = 0; bottom < rows; ++bottom) {
      std::vector<Share> strips(rows);  // of each row, from `left` on
      for (std::size_t right = left; right < columns; ++right) {
        Share share;
        for (std::size_t top = bottom; top < rows; ++top) {
          strips[top].add(cells[top * columns + right]);
          share.add(strips[top]);
          answer.offer(share, [&] {
            const auto edge = [cell](double origin, std::size_t i) {
              return short_number(origin + cell * static_cast<double>(i));
            };
            return "at x from " + edge(floor.x0, left) + " to " + edge(floor.x0, right + 1) + " m, y from " +
                   edge(floor.y0, bottom) + " to " + edge(floor.y0, top + 1) + " m";
          });
        }
      }
    }
  }
}

}  // namespace

double FrameGains::along(Column column) const {
  double sum = 0.0;
  for (const auto& flight : nats) sum += flight.col(column).sum();
  return sum;
}

FrameGains gains_of_effects(const Problem& problem, const Fit& nominal, const Fit& final) {
  return squares_less(problem, evaluate(problem, nominal.effects, {}, final.noise), final);
}

FrameGains gains_of_slow_force(const Problem& problem, const Fit& final, const NoiseModel& ordinary) {
  const Fit before = evaluate(problem, final.effects, {}, ordinary);
  FrameGains gains = squares_less(problem, before, final);
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const auto narrow = (*problem.flights)[f].whiteners(ordinary);
    const auto wide = (*problem.flights)[f].whiteners(final.noise);
    for (Eigen::Index i = 0; i < gains.nats[f].rows(); ++i) {
      const auto cost = [&](Axis axis) {
        return (*wide)[axis].log_deviation(static_cast<std::size_t>(i)) -
               (*narrow)[axis].log_deviation(static_cast<std::size_t>(i));
      };
      gains.nats[f](i, FrameGains::kWorldX) -= cost(kX);
      gains.nats[f](i, FrameGains::kWorldY) -= cost(kY);
      gains.nats[f](i, FrameGains::kInYaw) -= cost(kYaw);
      const double mean = 0.5 * (cost(kX) + cost(kY));
      gains.nats[f](i, FrameGains::kForward) -= mean;
      gains.nats[f](i, FrameGains::kLeft) -= mean;
    }
  }
  return gains;
}

std::array<double, kAxes> axis_shares(const FrameGains& gains) {
  std::array<double, kAxes> shares{0.0, 0.0, 0.0};
  if (!(gains.total() > 0.0)) return shares;
  for (int axis = 0; axis < kAxes; ++axis)
    shares[static_cast<std::size_t>(axis)] =
        std::max(0.0, gains.along(static_cast<FrameGains::Column>(axis))) / gains.total();
  return shares;
}

std::string text_of(const Place& place) {
  return place.statement + " (" + short_number(100.0 * place.share) + " % of it; evenly spread " +
         short_number(100.0 * place.even_share) + " % would lie there)";
}

std::vector<Place> locate(const Problem& problem, const FrameGains& gains) {
  if (!(gains.total() > 0.0)) return {};
  const std::vector<Observed> frames = observed_frames(problem, gains);
  const Share all{gains.total(), static_cast<double>(frames.size())};
  std::vector<std::string> names;
  for (const Flight& flight : *problem.flights) names.push_back(flight.recording().name);
  std::deque<Answer> answers;  // references to its elements last
  const auto question = [&](const std::string& what) -> Answer& { return answers.emplace_back(what, all); };

  Answer& axis = question("axis");
  const std::pair<FrameGains::Column, const char*> columns[] = {
      {FrameGains::kWorldX, "along the world's x axis"},
      {FrameGains::kWorldY, "along the world's y axis"},
      {FrameGains::kInYaw, "in yaw"},
      {FrameGains::kForward, "along the body's x axis"},
      {FrameGains::kLeft, "along the body's y axis"}};
  for (const auto& [column, statement] : columns) {
    const std::string text = statement;
    axis.offer({gains.along(column), all.frames / kAxes}, [&] { return text; });
  }
  axis.offer({gains.along(FrameGains::kWorldX) + gains.along(FrameGains::kWorldY), all.frames * 2 / kAxes},
             [] { return "in the translation, not in yaw"; });

  const std::vector<Second> seconds = seconds_of(frames);
  Answer& time = question("time");
  offer_moments(seconds, names, all.nats, time);
  offer_stretches(seconds, names, time);

  offer_places(frames, visited(*problem.flights), question("place"));

  Answer& recording = question("recording");
  for (std::size_t f = 0; f < names.size(); ++f)
    recording.offer(share_where(frames, [f](const Observed& i) { return i.flight == f; }),
                    [&] { return "in " + names[f]; });

  Answer& thruster = question("regime");
  for (std::size_t k = 0; k < frames.front().fired.size(); ++k) {
    for (const bool fires : {true, false})
      thruster.offer(share_where(frames, [&](const Observed& i) { return i.fired[k] == fires; }), [&] {
        return "while thruster " + std::to_string(k + 1) + (fires ? " fires" : " does not fire");
      });
  }
  offer_thresholds(
      frames, [](const Observed& i) { return static_cast<double>(i.open()); },
      [](bool above, double count) {
        return above ? "while " + short_number(count + 1.0) + " or more thrusters fire"
                     : "while " + short_number(count) + " thrusters or fewer fire";
      },
      question("regime"));
  offer_thresholds(
      frames, [](const Observed& i) { return i.speed_m_s; },
      [](bool above, double speed) {
        return std::string("while it moves ") + (above ? "faster" : "slower") + " than " +
               short_number(speed) + " m/s";
      },
      question("regime"));
  offer_thresholds(
      frames, [](const Observed& i) { return i.turn_rate_rad_s; },
      [](bool above, double rate) {
        return std::string("while it turns ") + (above ? "faster" : "slower") + " than " +
               short_number(rate * 180.0 / M_PI) + " deg/s";
      },
      question("regime"));
  Answer& heading = question("regime");
  for (const double middle : {0.0, 45.0, 90.0, 135.0, 180.0, -135.0, -90.0, -45.0}) {
    const auto near = [middle](const Observed& i) {
      return std::abs(wrap_angle(i.yaw_rad - middle * M_PI / 180.0)) < M_PI / 4.0;
    };
    heading.offer(share_where(frames, near),
                  [&] { return "while its yaw is within 45 deg of " + short_number(middle) + " deg"; });
  }
  if (names.size() > 1) {  // of a single flight both are its time
    offer_thresholds(
        frames, [](const Observed& i) { return i.gas_kg; },
        [](bool above, double gas) {
          return std::string(above ? "after" : "before") + " " + short_number(gas) +
                 " kg of gas have been used";
        },
        question("regime"));
    offer_thresholds(
        frames, [](const Observed& i) { return i.since_s; },
        [](bool above, double since) {
          return (above ? "later than " : "earlier than ") + short_number(since) +
                 " s after each first command";
        },
        question("regime"));
  }

  std::stable_sort(answers.begin(), answers.end(),
                   [](const Answer& a, const Answer& b) { return a.entropy() > b.entropy(); });
  std::vector<Place> places;
  for (const Answer& answer : answers) {
    if (answer.entropy() > 0.0) places.push_back(answer.place());
  }
  return places;
}

}  // namespace atmos
