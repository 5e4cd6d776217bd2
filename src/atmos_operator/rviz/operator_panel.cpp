#include "operator_panel.h"

#include <atmos_msgs/SetFlightMode.h>
#include <ros/master.h>
#include <rviz/properties/property.h>
#include <rviz/tool.h>
#include <rviz/tool_manager.h>
#include <rviz/visualization_manager.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <pluginlib/class_list_macros.hpp>

#include <QComboBox>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QTimer>
#include <QVBoxLayout>
#include <algorithm>

namespace atmos {

namespace {

constexpr int kRefresh_ms = 100, kDiscovery_ms = 1000;
constexpr const char* kToolClass = "atmos_operator/SetPoint";
constexpr const char* kButtonStyle =
    "QPushButton { font-weight: bold; padding: 5px; border-radius: 3px; color: white; background: %1; }"
    "QPushButton:disabled { color: #8a8f98; background: #d5d9df; }";

const char* color_of(Health health) {
  switch (health) {
    case Health::kGood:
      return "#1f8a4c";
    case Health::kWarning:
      return "#b36b00";
    case Health::kBad:
      return "#c62828";
    case Health::kUnknown:
      break;
  }
  return "#6b7280";
}

std::vector<std::string> robots_of_master() {
  ros::master::V_TopicInfo infos;
  if (!ros::master::getTopics(infos)) return {};
  std::vector<std::pair<std::string, std::string>> topics;
  for (const auto& info : infos) topics.emplace_back(info.name, info.datatype);
  return robots_among(topics);
}

QHBoxLayout* in_a_row(std::initializer_list<QWidget*> widgets) {
  auto* row = new QHBoxLayout;
  for (QWidget* widget : widgets) row->addWidget(widget);
  return row;
}

}  // namespace

OperatorPanel::OperatorPanel(QWidget* parent) : rviz::Panel(parent) {
  robot_box_ = new QComboBox;
  robot_box_->setObjectName("robot");
  mode_box_ = new QComboBox;
  mode_box_->setObjectName("mode");
  // Offboard is reached by arming.
  mode_box_->addItems({"manual", "acro", "stabilized", "position"});

  arm_ = button("arm", "Arm", "streams set-points, switches to offboard, arms: valves may open");
  disarm_ = button("disarm", "Disarm", "manual mode, then disarmed");
  kill_ = button("kill", "KILL", "disarms this robot by force, until released");
  kill_all_ = button("kill_all", "KILL ALL", "disarms every robot by force, until released");
  release_kill_ = button("release_kill", "Release kill", "lets the robot be armed again");
  set_mode_ = button("set_mode", "Set mode", "asks the autopilot for the mode; offboard: Arm");
  start_ = button("start_mission", "Start mission", "set-points and trajectories from their beginning");
  stop_ = button("stop_mission", "Stop mission", "the robot holds the place where it is");
  release_hold_ =
      button("release_hold", "Release hold", "robots stopped by the distance monitor may move again");
  arm_->setStyleSheet(QString(kButtonStyle).arg("#1f8a4c"));
  for (QPushButton* red : {kill_, kill_all_}) red->setStyleSheet(QString(kButtonStyle).arg("#c62828"));

  answer_ = new QLabel;
  answer_->setObjectName("answer");
  answer_->setWordWrap(true);
  answer_->setMinimumHeight(2 * answer_->fontMetrics().height());
  rows_ = new QGridLayout;
  rows_->setColumnStretch(1, 1);
  rows_->setVerticalSpacing(3);

  auto* layout = new QVBoxLayout(this);
  layout->addLayout(in_a_row({new QLabel("Robot"), robot_box_}));
  layout->addLayout(in_a_row({arm_, disarm_}));
  layout->addLayout(in_a_row({kill_, kill_all_, release_kill_}));
  layout->addLayout(in_a_row({mode_box_, set_mode_}));
  layout->addLayout(in_a_row({start_, stop_}));
  layout->addLayout(rows_);
  layout->addWidget(release_hold_);
  layout->addWidget(answer_);
  layout->addStretch(1);

  connect(robot_box_, QOverload<int>::of(&QComboBox::activated), this, [this](int index) {
    choose(robots_.at(static_cast<std::size_t>(index)));
    Q_EMIT configChanged();
  });
  connect(arm_, &QPushButton::clicked, this, [this] { set_flag("arm", "px4/arm", true); });
  connect(disarm_, &QPushButton::clicked, this, [this] { set_flag("disarm", "px4/arm", false); });
  connect(kill_, &QPushButton::clicked, this, [this] { set_flag("kill", "px4/kill", true); });
  connect(release_kill_, &QPushButton::clicked, this,
          [this] { set_flag("release kill", "px4/kill", false); });
  connect(kill_all_, &QPushButton::clicked, this, &OperatorPanel::kill_all);
  connect(set_mode_, &QPushButton::clicked, this, &OperatorPanel::set_mode);
  connect(start_, &QPushButton::clicked, this, [this] { trigger("start mission", "setpoint_player/start"); });
  connect(stop_, &QPushButton::clicked, this, [this] { trigger("stop mission", "setpoint_player/stop"); });
  connect(release_hold_, &QPushButton::clicked, this,
          [this] { trigger("release hold", "/distance_monitor/release"); });

  auto* timer = new QTimer(this);
  connect(timer, &QTimer::timeout, this, &OperatorPanel::refresh);
  timer->start(kRefresh_ms);
  auto* discovery = new QTimer(this);
  connect(discovery, &QTimer::timeout, this, &OperatorPanel::refresh_robots);
  discovery->start(kDiscovery_ms);
  refresh();
}

void OperatorPanel::onInitialize() {
  connect(vis_manager_->getToolManager(), &rviz::ToolManager::toolAdded, this, [this] { tell_tools(); });
  tell_tools();
}

void OperatorPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString robot;
  if (config.mapGetString("Robot", &robot) && !robot.isEmpty()) choose(robot.toStdString());
}

void OperatorPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Robot", QString::fromStdString(robot_));
}

QPushButton* OperatorPanel::button(const char* name, const QString& label, const QString& tip) {
  auto* made = new QPushButton(label);
  made->setObjectName(name);
  made->setToolTip(tip);
  return made;
}

void OperatorPanel::choose(const std::string& robot) {
  robot_ = robot;
  listener_.listen_to(robot);
  tell_tools();
  refresh();
}

// The set-point tool sends to the robot that is chosen here.
void OperatorPanel::tell_tools() const {
  if (vis_manager_ == nullptr || robot_.empty()) return;
  rviz::ToolManager* tools = vis_manager_->getToolManager();
  for (int i = 0; i < tools->numTools(); ++i) {
    if (tools->getTool(i)->getClassId() == kToolClass)
      tools->getTool(i)->getPropertyContainer()->subProp("Robot")->setValue(QString::fromStdString(robot_));
  }
}

void OperatorPanel::set_flag(const std::string& what, const std::string& service, bool value) {
  std_srvs::SetBool::Request request;
  request.data = value;
  calls_.call<std_srvs::SetBool>(what + " " + robot_, robot_ + "/" + service, request);
}

void OperatorPanel::trigger(const std::string& what, const std::string& service) {
  calls_.call<std_srvs::Trigger>(what + " " + robot_, service[0] == '/' ? service : robot_ + "/" + service,
                                 {});
}

void OperatorPanel::kill_all() {
  std_srvs::SetBool::Request request;
  request.data = true;
  for (const std::string& robot : robots_)
    calls_.call<std_srvs::SetBool>("kill " + robot, robot + "/px4/kill", request);
}

void OperatorPanel::set_mode() {
  atmos_msgs::SetFlightMode::Request request;
  request.mode = mode_box_->currentText().toStdString();
  calls_.call<atmos_msgs::SetFlightMode>("mode " + request.mode + " " + robot_, robot_ + "/px4/set_mode",
                                         request);
}

void OperatorPanel::refresh() {
  const double now = report_time();
  const PanelButtons enabled = panel_buttons(listener_.report(), now);
  arm_->setEnabled(enabled.arm);
  disarm_->setEnabled(enabled.disarm);
  kill_->setEnabled(enabled.kill);
  kill_all_->setEnabled(enabled.kill);
  release_kill_->setEnabled(enabled.release_kill);
  set_mode_->setEnabled(enabled.mode);
  start_->setEnabled(enabled.start_mission);
  stop_->setEnabled(enabled.stop_mission);
  release_hold_->setEnabled(enabled.release_hold);

  const std::vector<PanelRow> rows = panel_rows(listener_.report(), now);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i == row_labels_.size()) {
      row_labels_.emplace_back(new QLabel, new QLabel);
      row_labels_[i].second->setWordWrap(true);
      rows_->addWidget(row_labels_[i].first, static_cast<int>(i), 0, Qt::AlignTop);
      rows_->addWidget(row_labels_[i].second, static_cast<int>(i), 1);
    }
    const auto [name, text] = row_labels_[i];
    name->setText(QString::fromStdString(rows[i].name));
    text->setText(QString::fromStdString(rows[i].text));
    text->setToolTip(text->text());
    // A layout in a dock does not grow by itself for text that wraps.
    text->setMinimumHeight(text->heightForWidth(std::max(text->width(), 100)));
    text->setStyleSheet(QString("color: %1; font-weight: bold;").arg(color_of(rows[i].health)));
  }
  const std::string answer = calls_.poll();
  if (!answer.empty()) answer_->setText(QString::fromStdString(answer));
}

// The master is asked beside the thread that draws: it may be gone.
void OperatorPanel::refresh_robots() {
  if (!discovery_.valid()) {
    discovery_ = std::async(std::launch::async, robots_of_master);
  } else if (discovery_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    show_robots(discovery_.get());
  }
}

void OperatorPanel::show_robots(const std::vector<std::string>& robots) {
  // A robot that was seen stays in the list: it is not to vanish when its nodes die.
  std::vector<std::string> all = robots_;
  for (const std::string& robot : robots) {
    if (std::find(all.begin(), all.end(), robot) == all.end()) all.push_back(robot);
  }
  if (all.empty() || (all == robots_ && !robot_.empty())) return;
  robots_ = all;
  robot_box_->clear();
  for (const std::string& robot : robots_) robot_box_->addItem(QString::fromStdString(robot.substr(1)));
  if (robot_.empty()) choose(robots_.front());
  const auto chosen = std::find(robots_.begin(), robots_.end(), robot_);
  if (chosen != robots_.end()) robot_box_->setCurrentIndex(static_cast<int>(chosen - robots_.begin()));
}

}  // namespace atmos

PLUGINLIB_EXPORT_CLASS(atmos::OperatorPanel, rviz::Panel)
