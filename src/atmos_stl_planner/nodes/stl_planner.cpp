// A specification (~specification) in, a certified `trajectory` per robot out, in the namespace of the
// robot's name. The plan is made before the flight starts; its time counts from ~start_delay_s after the
// first valid ROS time. Plans anew from the way when the robustness predicted falls under ~replan_below_m:
// the old plan is followed until the new one is certified. Without a plan it says why on stderr, publishes
// that on `stl/plan` and ends with exit code 1.
#include <ros/ros.h>

#include <chrono>
#include <future>
#include <optional>

#include "atmos_model/steady_clock.h"
#include "atmos_model_ros/node.h"
#include "atmos_stl_planner/choice_search.h"
#include "atmos_stl_planner/diagnosis.h"
#include "atmos_stl_planner/supervisor.h"
#include "fleet_odometry.h"
#include "stl_messages.h"

namespace atmos::stl {
namespace {

constexpr double kCheck_s = 0.5;       // between two looks at the prediction
constexpr double kGain_m = 0.01;       // a new plan must be able to bring more than this
constexpr double kDiagnosis_s = 10.0;  // wall time for saying why there is no plan

class PlannerNode {
 public:
  PlannerNode(const Specification& spec, MilpSolver& solver, const Plan& plan, double t0_s,
              double replan_below_m, double plan_ahead_s)
      : spec_(spec),
        solver_(solver),
        plan_(plan),
        t0_s_(t0_s),
        replan_below_m_(replan_below_m),
        plan_ahead_s_(plan_ahead_s),
        supervisor_(spec, plan.motion),
        odometry_(node_, spec, [this](double stamp, const auto& p) { on_sample(stamp, p); }) {
    plan_pub_ = node_.advertise<atmos_msgs::StlPlan>("stl/plan", 10, true);
    marker_pub_ = node_.advertise<visualization_msgs::MarkerArray>("stl/markers", 1, true);
    publish_plan();
    for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
      // Whoever starts to listen gets the whole plan: it says itself from when it holds.
      trajectory_pubs_.push_back(node_.advertise<trajectory_msgs::MultiDOFJointTrajectory>(
          "/" + spec.robots[robot].name + "/trajectory", 10,
          [this, robot](const ros::SingleSubscriberPublisher& newcomer) {
            newcomer.publish(trajectory_message(spec_, plan_.motion, robot, t0_s_, from_s_));
          }));
    }
  }

  ~PlannerNode() {
    if (next_.valid()) next_.wait();
  }

 private:
  struct Next {
    Plan plan;
    double from_s, predicted_m;
  };

  void publish_plan() {
    atmos_msgs::StlPlan message = plan_message(spec_, plan_, t0_s_);
    message.replans = replans_;
    plan_pub_.publish(message);
    marker_pub_.publish(markers(spec_, &plan_));
  }

  void on_sample(double stamp_s, const std::vector<Eigen::Vector2d>& p) {
    const double time = stamp_s - t0_s_;
    supervisor_.fly(time, p);
    if (next_.valid()) {
      if (next_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) take(next_.get(), time);
      return;
    }
    if (time < next_check_s_ || time > spec_.horizon_s - plan_ahead_s_) return;
    next_check_s_ = time + kCheck_s;
    const std::optional<double> predicted = supervisor_.predicted_m();
    if (!predicted || *predicted >= replan_below_m_ || lost_) return;
    const double from = supervisor_.last_s() + plan_ahead_s_;
    const std::optional<Past> past = supervisor_.past_at(from);
    if (!past) return;
    // No use in planning for what the past has made impossible.
    const double bound = robustness_bound(spec_, Scope::all(spec_), &*past);
    if (bound < spec_.planner.min_robustness_m) {
      lost_ = true;
      ROS_ERROR("%s: robustness %.3f m is lost, no plan can bring it back", spec_.name.c_str(), *predicted);
    }
    if (lost_ || bound < *predicted + kGain_m || *predicted > settled_m_ - kGain_m) return;
    ROS_WARN("%s: robustness predicted at %.1f s is %.3f m: planning anew", spec_.name.c_str(), time,
             *predicted);
    next_ = std::async(std::launch::async, [this, past = *past, from, expected = *predicted] {
      return Next{Planner(spec_, solver_, steady_seconds).plan(&past), from, expected};
    });
  }

  void take(const Next& next, double time_s) {
    if (next.plan.status != PlanStatus::kPlanned) {
      ROS_WARN("%s: no new plan from %.1f s on: the old one is followed", spec_.name.c_str(), next.from_s);
      return;
    }
    if (time_s > next.from_s) {
      ROS_WARN("%s: the new plan came %.1f s late: the old one is followed", spec_.name.c_str(),
               time_s - next.from_s);
      return;
    }
    if (next.plan.certificate.robustness_m < next.predicted_m + kGain_m) {
      settled_m_ = next.predicted_m;
      ROS_WARN("%s: no plan from %.1f s on has more than %.3f m: the old one is followed", spec_.name.c_str(),
               next.from_s, next.plan.certificate.robustness_m);
      return;
    }
    plan_ = next.plan;
    from_s_ = next.from_s;
    ++replans_;
    supervisor_.follow(plan_.motion);
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot)
      trajectory_pubs_[robot].publish(trajectory_message(spec_, plan_.motion, robot, t0_s_, from_s_));
    publish_plan();
    ROS_INFO("%s: new plan from %.1f s on, robustness %.3f m, planned in %.2f s", spec_.name.c_str(), from_s_,
             plan_.certificate.robustness_m, plan_.total_s);
  }

  ros::NodeHandle node_;
  const Specification spec_;
  MilpSolver& solver_;
  Plan plan_;
  double t0_s_, from_s_ = 0.0, replan_below_m_, plan_ahead_s_;
  double next_check_s_ = 0.0;
  bool lost_ = false;
  double settled_m_ = kUnbounded;  // predicted when a new plan brought nothing: tried again only below it
  std::uint32_t replans_ = 0;
  Supervisor supervisor_;
  std::future<Next> next_;
  ros::Publisher plan_pub_, marker_pub_;
  std::vector<ros::Publisher> trajectory_pubs_;
  FleetOdometry odometry_;  // last: its callbacks use the rest
};

int refuse(const Specification& spec, MilpSolver& solver, const Plan& plan) {
  std::fprintf(stderr, "%s: no certified plan%s\n", spec.path.c_str(),
               plan.status == PlanStatus::kTimeLimit ? " within the time limit" : "");
  if (!plan.method.empty()) std::fprintf(stderr, "%s\n", plan.method.c_str());
  if (plan.status == PlanStatus::kInfeasible) {
    Diagnosis diagnosis(spec, solver, steady_seconds);
    const Conflict conflict = diagnosis.conflict(kDiagnosis_s);
    std::fprintf(stderr, "%s", explanation(conflict, diagnosis.relaxations(conflict, kDiagnosis_s)).c_str());
  }
  ros::NodeHandle node;
  ros::Publisher publisher = node.advertise<atmos_msgs::StlPlan>("stl/plan", 1, true);
  publisher.publish(plan_message(spec, plan, 0.0));
  ros::WallDuration(0.5).sleep();  // until the message has left
  return 1;
}

int run() {
  ros::NodeHandle private_node("~");
  const Specification spec =
      load_specification(required_parameter<std::string>(private_node, "specification"));
  const double delay = private_node.param("start_delay_s", 5.0);
  const double replan_below = private_node.param("replan_below_m", 0.0);
  const double plan_ahead = private_node.param("plan_ahead_s", 2.0);
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  const Plan plan = Planner(spec, *solver, steady_seconds).plan();
  if (plan.status != PlanStatus::kPlanned) return refuse(spec, *solver, plan);
  ROS_INFO("%s: robustness %.3f m of %.3f m possible, planned in %.2f s, %s", spec.name.c_str(),
           plan.certificate.robustness_m, plan.bound_m, plan.total_s, plan.method.c_str());
  ros::Time::waitForValid();
  PlannerNode node(spec, *solver, plan, ros::Time::now().toSec() + delay, replan_below, plan_ahead);
  ros::spin();
  return 0;
}

}  // namespace
}  // namespace atmos::stl

int main(int argc, char** argv) { return atmos::run_node(argc, argv, "stl_planner", atmos::stl::run); }
